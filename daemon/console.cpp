// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/console.hpp"

#include <chrono>

namespace maplet::daemon {

namespace {

constexpr auto kPatience = std::chrono::seconds{3};
constexpr double kRejected = 1e-3;  // a weight below is none

}  // namespace

std::string Console::open(const std::string& path) {
  auto server = ControlServer::start(path, about_us_.identity.agent,
                                     [this](const std::string& line) { return reply(line); });
  if (!server) return server.error();
  server_ = std::move(*server);
  return {};
}

bool Console::ask(Question question, int agent) {
  std::unique_lock lock{question_mutex_};
  question_ = question;
  about_ = agent;
  answered_ = false;
  asked_.store(true, std::memory_order_release);
  const bool good = answered_cv_.wait_for(lock, kPatience, [this] { return answered_; });
  asked_ = false;
  return good;
}

void Console::answer(Agent& agent, Deadline deadline) noexcept {
  if (deadline.expired()) return;
  const std::unique_lock lock{question_mutex_, std::try_to_lock};
  if (!lock || !asked_ || answered_) return;
  switch (question_) {
    case Question::kClosures:
      list_closures(agent);
      break;
    case Question::kMaplets:
      list_maplets(agent);
      break;
    case Question::kWhy:
      look_into(agent);
      break;
    case Question::kAdd:
      add_closure(agent, deadline);
      break;
    case Question::kDecide:
      decide_closure(agent, deadline);
      break;
    case Question::kWay:
      find_way(agent);
      break;
    case Question::kOverlay:
      lay_part_over(agent);
      break;
  }
  answered_ = true;
  answered_cv_.notify_one();
}

void Console::list_closures(const Agent& agent) noexcept {
  const Skeleton& skeleton = agent.skeleton();
  closure_count_ = 0;
  for (int i = 0; i < skeleton.factor_count() && closure_count_ < kMaxClosures; ++i) {
    const Skeleton::FactorView factor = skeleton.factor(i);
    if (factor.kind != DeltaPose::Kind::kClosure) continue;
    closures_[closure_count_++] = {factor.a,
                                   factor.b,
                                   factor.chi2,
                                   factor.weight,
                                   factor.T_a_b.t.norm(),
                                   factor.verdict == ClosureState::kTorn};
  }
}

void Console::list_maplets(const Agent& agent) noexcept {
  const Skeleton& skeleton = agent.skeleton();
  maplet_count_ = 0;
  for (int i = 0; i < skeleton.node_count() && maplet_count_ < maplets_.size(); ++i) {
    const Skeleton::NodeView node = skeleton.node(i);
    const bool own =
        node.key.agent == about_us_.identity.agent && node.key.epoch == about_us_.identity.epoch;
    const auto held = own ? agent.maplets().find(node.key) : std::nullopt;
    maplets_[maplet_count_++] = {node, held ? static_cast<std::uint32_t>(held->size()) : 0};
  }
}

bool Console::find_named(const Skeleton& skeleton, MapletKey& a, MapletKey& b) const noexcept {
  bool found_a = false;
  bool found_b = false;
  for (int i = 0; i < skeleton.node_count(); ++i) {  // the latest life of each
    const MapletKey key = skeleton.node(i).key;
    if (key.agent == new_closure_.agent_a && key.id == new_closure_.id_a) {
      a = key;
      found_a = true;
    }
    if (key.agent == new_closure_.agent_b && key.id == new_closure_.id_b) {
      b = key;
      found_b = true;
    }
  }
  return found_a && found_b && !(a == b);
}

void Console::add_closure(Agent& agent, Deadline deadline) noexcept {
  DeltaPose closure;
  closure.kind = DeltaPose::Kind::kClosure;
  added_ = AddedClosure::kUnknownMaplet;
  if (!find_named(agent.skeleton(), closure.a, closure.b)) return;
  closure.T_a_b.se3 = new_closure_.T_a_b;
  closure.covariance.diagonal() << 1e-3, 1e-3, 1e-3, 1e-3, 1e-3, 1e-3;
  if (about_us_.flight != nullptr) about_us_.flight->said(closure);
  added_ = agent.say(closure, deadline) ? AddedClosure::kAdded : AddedClosure::kRefused;
}

void Console::decide_closure(Agent& agent, Deadline deadline) noexcept {
  MapletKey a;
  MapletKey b;
  decided_ = -1;
  if (!find_named(agent.skeleton(), a, b)) return;
  if (about_us_.flight != nullptr) about_us_.flight->decided(a, b, accept_);
  decided_ = agent.decide(a, b, accept_, deadline);
  if (decided_ > 0 && about_us_.journal != nullptr)
    about_us_.journal->put(journal::Decision{a, b, accept_});
}

void Console::look_into(const Agent& agent) noexcept {
  const Skeleton& skeleton = agent.skeleton();
  why_ = {};
  const MapletKey* own_gauge = nullptr;
  MapletKey gauge;
  for (int i = 0; i < skeleton.node_count(); ++i) {
    const Skeleton::NodeView node = skeleton.node(i);
    if (node.key.agent != about_us_.identity.agent || node.key.epoch != about_us_.identity.epoch)
      continue;
    gauge = node.gauge;
    own_gauge = &gauge;
  }
  for (int i = 0; i < skeleton.node_count(); ++i) {
    const Skeleton::NodeView node = skeleton.node(i);
    if (node.key.agent != about_) continue;
    ++why_.nodes;
    if (own_gauge != nullptr && node.gauge == *own_gauge) ++why_.related;
  }
  for (const EncounterCounts& counts : agent.encounters().counts()) {
    if (counts.agent == about_) why_.looked = counts;
  }
  for (int i = 0; i < skeleton.factor_count(); ++i) {
    const Skeleton::FactorView factor = skeleton.factor(i);
    if (factor.kind != DeltaPose::Kind::kClosure || factor.a.agent == factor.b.agent) continue;
    if (factor.a.agent != about_ && factor.b.agent != about_) continue;
    ++why_.closures;
    if (factor.weight > kRejected) ++why_.closures_kept;
    if (factor.verdict == ClosureState::kTorn) ++why_.closures_torn;
  }
}

}  // namespace maplet::daemon
