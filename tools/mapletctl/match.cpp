// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include <fmt/core.h>

#include <algorithm>
#include <filesystem>
#include <map>
#include <memory>
#include <nlohmann/json.hpp>

#include "core/maplet/shared_keyframe.hpp"
#include "core/registration/icap.hpp"
#include "core/registration/place_index.hpp"
#include "core/registration/place_verifier.hpp"
#include "tools/files/maplet_file.hpp"
#include "tools/files/run_folder.hpp"
#include "tools/mapletctl/command.hpp"
#include "tools/mapletctl/planar_option.hpp"

namespace maplet::ctl {
namespace {

namespace fs = std::filesystem;
using Json = nlohmann::ordered_json;

struct Options {
  std::string a, b;
  bool planar = false;
  bool json = false;
};

// A run's maplets, and how they lie to each other as its skeleton has it. Keys are given anew: two
// runs may be of one agent.
struct Side {
  std::vector<std::unique_ptr<Maplet>> maplets;
  std::vector<std::string> names;  // NNNN of the files
  std::map<MapletKey, Se3> T_world_maplet;
  bool damaged = false;  // some file was
  bool without_paths = false;
};

Side read_side(const std::string& folder, std::uint16_t agent) {
  Side side;
  std::vector<fs::path> files;
  fs::path maplets{folder};
  if (fs::is_directory(maplets / "maplets")) maplets /= "maplets";
  if (fs::is_regular_file(maplets)) {
    throw Failure{folder +
                  " is a file: give a folder of mapletd --out (two maplets alone: "
                  "mapletctl register)"};
  }
  std::error_code error;
  for (const auto& entry : fs::directory_iterator{maplets, error}) {
    if (entry.path().extension() == ".maplet") files.push_back(entry.path());
  }
  if (error) throw Failure{fmt::format("cannot read {}: {}", maplets.string(), error.message())};
  if (files.empty()) {
    throw Failure{fmt::format("{} holds no maplets: give a folder of mapletd --out", folder)};
  }
  std::sort(files.begin(), files.end());
  fs::path run{folder};  // or its maplets/ alone
  if (!fs::exists(run / "skeleton.g2o") && fs::exists(run / ".." / "skeleton.g2o")) run /= "..";
  const std::map<std::uint32_t, Se3> nodes = files::read_nodes(run.string());
  for (const fs::path& file : files) {
    try {
      side.maplets.push_back(files::read_maplet(file));
    } catch (const std::runtime_error& e) {
      fmt::print(stderr, "mapletctl: {}; going on without it\n", e.what());
      side.damaged = true;
      continue;
    }
    side.names.push_back(file.stem().string());
    MapletKey& key = side.maplets.back()->key;
    const auto node = nodes.find(key.id);
    key = {agent, 0, static_cast<std::uint32_t>(side.names.size() - 1)};
    if (node != nodes.end()) side.T_world_maplet[key] = node->second;
  }
  side.without_paths = side.maplets.size() > 1 && side.T_world_maplet.empty();
  if (side.without_paths) {
    fmt::print(
        stderr,
        "mapletctl: {}: no skeleton.g2o that says how its maplets lie to each other: a place "
        "that is alike cannot be told from the same, nothing is accepted\n",
        folder);
  }
  return side;
}

class Skeletons final : public PlaceRelations {
 public:
  Skeletons(const Side& a, const Side& b) : nodes_{a.T_world_maplet} {
    nodes_.insert(b.T_world_maplet.begin(), b.T_world_maplet.end());
  }
  [[nodiscard]] bool relate(const MapletKey& x, const MapletKey& y,
                            Se3& T_x_y) const noexcept override {
    const auto at_x = nodes_.find(x);
    const auto at_y = nodes_.find(y);
    if (x.agent != y.agent || at_x == nodes_.end() || at_y == nodes_.end()) return false;
    T_x_y = at_x->second.inverse() * at_y->second;
    return true;
  }

 private:
  std::map<MapletKey, Se3> nodes_;
};

using Pair = std::pair<std::uint32_t, std::uint32_t>;  // ids of a, b
using Tried = std::map<Pair, PlaceCompare::Guesses>;

// What the place index proposes, asked from both sides.
Tried propose(const Side& a, const Side& b) {
  Tried tried;
  const auto ask = [&tried](const Side& stored, const Side& asking, bool turned) {
    Arena arena;
    PlaceIndex index{stored.maplets.size(), arena};
    for (const auto& m : stored.maplets) index.add(*m);
    for (const auto& m : asking.maplets) {
      for (const PlaceCandidate& c : index.query(*m, {}, Deadline::never())) {
        auto& guesses = tried[turned ? Pair{m->key.id, c.key.id} : Pair{c.key.id, m->key.id}];
        for (PlaceGuess guess : c.guesses) {
          if (turned) guess.T_a_b = guess.T_a_b.inverse();
          if (!full(guesses)) guesses.push_back(guess);
        }
      }
    }
  };
  ask(a, b, false);
  ask(b, a, true);
  return tried;
}

// How well planes fit that are surely the same: those of consecutive maplets.
void note_fits(const Side& side, const RegistrationConfig& config, PlaceVerifier& verifier) {
  const auto icap = std::make_unique<Icap>(config);
  for (std::size_t i = 1; i < side.maplets.size(); ++i) {
    const auto T_a_b = shared_keyframe(*side.maplets[i - 1], *side.maplets[i]);
    if (!T_a_b) continue;
    const auto found =
        icap->align(*side.maplets[i - 1], *side.maplets[i], Transform<MapletA, MapletB>{*T_a_b},
                    config.link_gate_m, config.link_gate_rad, Deadline::never());
    if (found) verifier.note_fit(found->chi2_per_dof);
  }
}

bool says(const PlaceHypothesis& h, const Pair& pair) {
  return h.a.id == pair.first && h.b.id == pair.second;
}

// Pairs near each other by what was accepted and the two skeletons, and not accepted yet.
Tried propose_near(const Side& a, const Side& b, const PlaceVerifier& verifier,
                   const PlaceRelations& relations) {
  constexpr double kNear_m = 3.5;
  constexpr double kNear_rad = 1.0;
  Tried tried;
  const auto all = verifier.hypotheses();
  for (const PlaceHypothesis& h : all) {
    // One closure alone might be wrong and make others so.
    if (h.judgement.verdict != Verdict::kAccept || h.support < 1.5 * h.value) continue;
    for (const auto& ma : a.maplets) {
      for (const auto& mb : b.maplets) {
        const Pair pair{ma->key.id, mb->key.id};
        Se3 T_a_from;
        Se3 T_to_b;
        if (ma->key != h.a && !relations.relate(ma->key, h.a, T_a_from)) continue;
        if (mb->key != h.b && !relations.relate(h.b, mb->key, T_to_b)) continue;
        if (T_a_from.t.norm() + T_to_b.t.norm() > kNear_m) continue;
        const Se3 T = T_a_from * h.alignment.T_a_b.se3 * T_to_b;
        if (T.t.norm() > kNear_m || T.angle() > kNear_rad || tried.contains(pair)) continue;
        const bool accepted = std::any_of(all.begin(), all.end(), [&](const auto& other) {
          return says(other, pair) && other.judgement.verdict == Verdict::kAccept;
        });
        if (!accepted) tried[pair].push_back({T, 1.0F});
      }
    }
  }
  return tried;
}

void verify(const Side& a, const Side& b, const Tried& tried, bool planar,
            PlaceVerifier& verifier) {
  for (const auto& [pair, guesses] : tried) {
    const Maplet& from = *a.maplets[pair.first];
    const Maplet& to = *b.maplets[pair.second];
    if (planar) {
      const PlanarMotion plane = plane_of(from, "maplet " + a.names[pair.first] + " of A");
      check_one_plane(plane, to, "maplet " + b.names[pair.second] + " of B");
      verifier.hold_to(plane);
    }
    verifier.add(from, to, guesses, Deadline::never());
  }
}

// Judges, and looks at what lies around those that are accepted, until no verdict changes.
void settle(const Side& a, const Side& b, const PlaceRelations& relations,
            PlaceVerifier& verifier) {
  verifier.hold_to(std::nullopt);
  const auto unlooked = [&]() -> std::optional<std::size_t> {
    const auto all = verifier.hypotheses();
    for (std::size_t i = 0; i < all.size(); ++i)
      if (all[i].judgement.verdict == Verdict::kAccept &&
          all[i].around == PlaceHypothesis::Around::kUnknown)
        return i;
    return std::nullopt;
  };
  verifier.judge(relations);
  for (auto i = unlooked(); i; i = unlooked()) {
    const PlaceHypothesis& h = verifier.hypotheses()[*i];
    Surroundings around;
    around.begin(h.a, h.b, h.alignment.T_a_b.se3);
    Se3 T;
    for (const auto& m : a.maplets)
      if (m->key != h.a && relations.relate(h.a, m->key, T)) around.put_beside_a(m->key, T);
    for (const auto& m : b.maplets)
      if (m->key != h.b && relations.relate(h.b, m->key, T)) around.put_beside_b(m->key, T);
    while (const Surroundings::Pair* pair = around.next()) {
      around.weigh(verifier.weigh_around(*a.maplets[pair->a.id], *b.maplets[pair->b.id], *pair,
                                         Deadline::never()));
    }
    verifier.note_around(*i, around.contradict());
    verifier.judge(relations);
  }
}

Judgement judgement_of(const Side& a, const Side& b, const PlaceHypothesis& h) {
  if (h.judgement.verdict == Verdict::kAccept && (a.without_paths || b.without_paths)) {
    return {Verdict::kUndecided, "no skeleton to tell it from a place that is alike"};
  }
  return h.judgement;
}

void print_pair(const Side& a, const Side& b, const PlaceHypothesis& h, bool json) {
  const Judgement judgement = judgement_of(a, b, h);
  const Se3& T = h.alignment.T_a_b.se3;
  if (json) {
    Json covariance = Json::array();
    for (int i = 0; i < 36; ++i) covariance.push_back(h.alignment.covariance.data()[i]);
    Json line{{"a", a.names[h.a.id]},
              {"b", b.names[h.b.id]},
              {"stamp_a_s", seconds(h.stamp_a)},
              {"stamp_b_s", seconds(h.stamp_b)},
              {"verdict", to_string(judgement.verdict)},
              {"reason", judgement.reason},
              {"T_a_b", {T.t.x(), T.t.y(), T.t.z(), T.q.x(), T.q.y(), T.q.z(), T.q.w()}},
              {"covariance", covariance},
              {"overlap", h.alignment.overlap},
              {"matches", h.alignment.matches},
              {"chi2_per_dof", h.alignment.chi2_per_dof},
              {"conflict", h.evidence.contradiction()},
              {"agreed_m", h.evidence.agreed}};
    if (h.alignment.plane != PlaneCode::kSpace) line["planar"] = planar_json(h.alignment);
    fmt::print("{}\n", line.dump());
    return;
  }
  fmt::print("{} {} {:>9}  {:.2f} {:.2f} {:.2f} m {:5.1f} deg, {:2} planes on {:3.0f} %: {}\n",
             a.names[h.a.id], b.names[h.b.id], to_string(judgement.verdict), T.t.x(), T.t.y(),
             T.t.z(), T.angle() * 57.29577951308232, h.alignment.matches,
             100.0 * h.alignment.overlap, judgement.reason);
}

void run(const Options& options) {
  const Side a = read_side(options.a, 1);
  const Side b = read_side(options.b, 2);
  const Skeletons relations{a, b};
  const RegistrationConfig config;
  Arena arena;
  const std::size_t pairs = a.maplets.size() * b.maplets.size();
  PlaceVerifier verifier{config, 2 * PlaceVerifier::kPerPair * pairs, arena};
  for (const Side* side : {&a, &b}) note_fits(*side, config, verifier);
  verify(a, b, propose(a, b), options.planar, verifier);
  settle(a, b, relations, verifier);
  const Tried near = propose_near(a, b, verifier, relations);
  if (!near.empty()) {
    verify(a, b, near, options.planar, verifier);
    settle(a, b, relations, verifier);
  }
  // A line a pair: what was accepted, or else what has most to say for itself.
  std::map<Pair, const PlaceHypothesis*> best;
  for (const PlaceHypothesis& h : verifier.hypotheses()) {
    const PlaceHypothesis*& kept = best[{h.a.id, h.b.id}];
    const auto rank = [](const PlaceHypothesis& x) {
      return std::pair{x.judgement.verdict == Verdict::kAccept, x.support};
    };
    if (kept == nullptr || rank(h) > rank(*kept)) kept = &h;
  }
  for (const auto& [pair, h] : best) print_pair(a, b, *h, options.json);
  const bool both = !a.maplets.empty() && !b.maplets.empty();
  if (best.empty() && both)
    fmt::print(options.json ? stderr : stdout, "no maplets of the two are alike\n");
  if (a.damaged || b.damaged) throw Failure{"match: not all maplets could be read"};
}

}  // namespace

void add_match(Command app) {
  auto options = std::make_shared<Options>();
  const Command command = app.add_command(
      "match", "Finds places that two runs have in common, nothing known about how they lie");
  command.add_option("a", options->a, "Folder of mapletd --out").required().type_name("DIR_A");
  command.add_option("b", options->b, "Folder of mapletd --out").required().type_name("DIR_B");
  command.add_flag("--planar", options->planar, kPlanarHelp);
  command.add_flag("--json", options->json, "A line of JSON for each verified pair");
  command.footer(
      "Examples:\n"
      "  mapletctl match out/first out/second                   two runs through one building\n"
      "  mapletctl match out/first out/second --json | grep '\"accept\"'");
  command.run([options] { run(*options); });
}

}  // namespace maplet::ctl
