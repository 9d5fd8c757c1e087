// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/console.hpp"

#include <chrono>

namespace maplet::daemon {

namespace {

constexpr auto kPatience = std::chrono::seconds{3};
constexpr double kRejected = 1e-3;  // a weight below is none

}  // namespace

std::string Console::open(const std::string& path) {
  auto server = ControlServer::start(path, identity_.agent,
                                     [this](const std::string& line) { return reply(line); });
  if (!server) return server.error();
  server_ = std::move(*server);
  return {};
}

void Console::note(const StatusRecord& status, const Skeleton& skeleton, bool settled) noexcept {
  const std::unique_lock lock{mutex_, std::try_to_lock};
  if (!lock) return;  // the next second
  status_ = status;
  settled_ = settled && skeleton.stop() == Stop::kConverged;
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
      list_closures(agent.skeleton());
      break;
    case Question::kWhy:
      look_into(agent);
      break;
  }
  answered_ = true;
  answered_cv_.notify_one();
}

void Console::list_closures(const Skeleton& skeleton) noexcept {
  closure_count_ = 0;
  for (int i = 0; i < skeleton.factor_count() && closure_count_ < kMaxClosures; ++i) {
    const Skeleton::FactorView factor = skeleton.factor(i);
    if (factor.kind != DeltaPose::Kind::kClosure) continue;
    closures_[closure_count_++] = {factor.a, factor.b, factor.chi2, factor.weight,
                                   factor.T_a_b.t.norm()};
  }
}

void Console::look_into(const Agent& agent) noexcept {
  const Skeleton& skeleton = agent.skeleton();
  why_ = {};
  const MapletKey* own_gauge = nullptr;
  MapletKey gauge;
  for (int i = 0; i < skeleton.node_count(); ++i) {
    const Skeleton::NodeView node = skeleton.node(i);
    if (node.key.agent != identity_.agent || node.key.epoch != identity_.epoch) continue;
    gauge = node.gauge;
    own_gauge = &gauge;
  }
  for (int i = 0; i < skeleton.node_count(); ++i) {
    const Skeleton::NodeView node = skeleton.node(i);
    if (node.key.agent != about_) continue;
    ++why_.nodes;
    if (own_gauge != nullptr && node.gauge == *own_gauge) ++why_.related;
  }
  for (int i = 0; i < skeleton.factor_count(); ++i) {
    const Skeleton::FactorView factor = skeleton.factor(i);
    if (factor.kind != DeltaPose::Kind::kClosure || factor.a.agent == factor.b.agent) continue;
    if (factor.a.agent != about_ && factor.b.agent != about_) continue;
    ++why_.closures;
    if (factor.weight > kRejected) ++why_.closures_kept;
  }
}

}  // namespace maplet::daemon
