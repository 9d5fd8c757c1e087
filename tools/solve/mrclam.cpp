// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include <cmath>
#include <cstring>

#include "core/skeleton/space.hpp"
#include "tools/solve/words.hpp"

namespace maplet::graphs {
namespace {

// Wheels: errors by the way and the turn of a second, with a floor for what the clock and the
// floor under the wheels do. The camera: by the distance.
constexpr double kSlip_m = 0.02, kSlipPerMetre = 0.15;
constexpr double kTurn_rad = 0.02, kTurnPerRad = 0.15;
constexpr double kRange_m = 0.05, kRangePerMetre = 0.05;
constexpr double kBearing_rad = 0.04;
constexpr double kFastest = 100.0;  // m/s, rad/s
constexpr double kFarthest_m = 1e6;
constexpr std::uint64_t kMostSeconds = 100'000;

/// A file of the folder.
struct Part {
  const std::string& text;
  std::string name;
  int folder;
};

/// Calls take(row, line) for lines of numbers; others are complained of.
template <class Take>
void for_each_row(const Part& part, int columns, GraphFile& graph, Take&& take) {
  std::string_view rest = part.text;
  for (int line = 1; !rest.empty(); ++line) {
    Words words{take_line(rest)};
    Words copy = words;
    const std::string_view first = copy.next();
    if (first.empty() || first.front() == '#') continue;
    std::array<double, 4> row{};
    if (const char* wrong = words.numbers(row.data(), columns)) {
      complain(graph, part.folder, line, wrong, part.name);
    } else {
      take(row, line);
    }
  }
}

std::vector<std::array<double, 4>> table(const Part& part, int columns, GraphFile& graph) {
  std::vector<std::array<double, 4>> rows;
  for_each_row(part, columns, graph, [&](const auto& row, int) { rows.push_back(row); });
  return rows;
}

std::string name_of(std::size_t robot, const char* what) {
  return "Robot" + std::to_string(robot + 1) + "_" + what + ".dat";
}

std::uint64_t robot_id(std::size_t robot, std::uint64_t second) {
  return symbol(static_cast<char>('A' + robot), second);
}

Se3 to_se3(const Se2& p) {
  const double half = 0.5 * p.angle();
  return {Eigen::Quaterniond{std::cos(half), 0.0, 0.0, std::sin(half)}, {p.x, p.y, 0.0}};
}

/// The way that wheels say a robot went, second by second from a common start.
class Odometry {
 public:
  Odometry(const std::vector<std::array<double, 4>>& rows, double start_s) : start_s_{start_s} {
    for (const auto& [stamp, speed, turn, unused] : rows) {
      const double t = stamp - start_s_;
      if (!(t >= 0.0) || !(t < kMostSeconds) || !(std::abs(speed) < kFastest) ||
          !(std::abs(turn) < kFastest))
        continue;
      if (!segments_.empty() && t <= segments_.back().t) continue;
      const Se2 at = segments_.empty() ? Se2{} : pose(t);
      segments_.push_back({t, at, speed, turn});
    }
  }
  [[nodiscard]] bool empty() const { return segments_.empty(); }
  [[nodiscard]] std::uint64_t first_second() const {
    return static_cast<std::uint64_t>(std::ceil(segments_.front().t));
  }
  [[nodiscard]] std::uint64_t last_second() const {
    return static_cast<std::uint64_t>(std::floor(segments_.back().t));
  }
  /// T_start_body at a time since the start; the last command holds on.
  [[nodiscard]] Se2 pose(double t) const {
    auto at = std::upper_bound(segments_.begin(), segments_.end(), t,
                               [](double v, const Segment& s) { return v < s.t; });
    if (at == segments_.begin()) return at->pose;
    --at;
    const double dt = t - at->t;
    const double turned = at->turn * dt;
    const double chord =
        at->speed * dt * (std::abs(turned) < 1e-9 ? 1.0 : std::sin(0.5 * turned) / (0.5 * turned));
    return PlanarSpace::compose(at->pose, Se2::from(chord * std::cos(0.5 * turned),
                                                    chord * std::sin(0.5 * turned), turned));
  }
  [[nodiscard]] Se2 between(double from, double to) const {
    return PlanarSpace::between(pose(from), pose(to));
  }

 private:
  struct Segment {
    double t;
    Se2 pose;
    double speed, turn;
  };
  double start_s_;
  std::vector<Segment> segments_;
};

struct Subject {
  bool robot = false;
  std::size_t number = 0;  ///< of the robot, or the landmark's
};

void add_odometry(std::size_t robot, const Odometry& odometry, double start_s, GraphFile& graph) {
  for (std::uint64_t k = odometry.first_second(); k <= odometry.last_second(); ++k) {
    graph.stamps_s[robot_id(robot, k)] = start_s + static_cast<double>(k);
    if (k == odometry.first_second()) continue;
    const auto t = static_cast<double>(k);
    const Se2 went = odometry.between(t - 1.0, t);
    const double slip = kSlip_m + kSlipPerMetre * std::hypot(went.x, went.y);
    const double turn = kTurn_rad + kTurnPerRad * std::abs(went.angle());
    Edge e;
    e.a = robot_id(robot, k - 1);
    e.b = robot_id(robot, k);
    e.z = to_se3(went);
    e.information(0, 0) = e.information(1, 1) = 1.0 / (slip * slip);
    e.information(5, 5) = 1.0 / (turn * turn);
    graph.edges.push_back(e);
  }
}

/// A sight of some moment, told by the pose of the nearest second: the wheels know what lies
/// between.
Edge sight(std::size_t robot, const Odometry& odometry, double t, double range, double bearing) {
  const std::uint64_t second = std::clamp(static_cast<std::uint64_t>(std::max(0.0, std::round(t))),
                                          odometry.first_second(), odometry.last_second());
  const Se2 moved = odometry.between(static_cast<double>(second), t);
  const Se2 seen =
      PlanarSpace::compose(moved, {range * std::cos(bearing), range * std::sin(bearing), 1.0, 0.0});
  Edge e;
  e.kind = FactorKind::kRangeBearing;
  e.a = robot_id(robot, second);
  e.range_m = std::hypot(seen.x, seen.y);
  e.bearing_rad = std::atan2(seen.y, seen.x);
  const double range_sigma = kRange_m + kRangePerMetre * range;
  e.information(0, 0) = 1.0 / (range_sigma * range_sigma);
  e.information(1, 1) = 1.0 / (kBearing_rad * kBearing_rad);
  return e;
}

void add_truth(std::size_t robot, const Part& part, const Odometry& odometry, double start_s,
               GraphFile& graph) {
  const auto rows = table(part, 4, graph);
  for (std::uint64_t k = odometry.first_second(); k <= odometry.last_second(); ++k) {
    const double t = start_s + static_cast<double>(k);
    const auto after = std::lower_bound(rows.begin(), rows.end(), t,
                                        [](const auto& row, double v) { return row[0] < v; });
    if (after == rows.begin() || after == rows.end()) continue;
    const auto& nearest = t - (*(after - 1))[0] < (*after)[0] - t ? *(after - 1) : *after;
    if (std::abs(nearest[0] - t) > 0.1) continue;
    graph.truth[robot_id(robot, k)] = to_se3(Se2::from(nearest[1], nearest[2], nearest[3]));
  }
}

}  // namespace

void read_mrclam(const MrclamTexts& texts, int file, GraphFile& graph) {
  graph.planar = true;
  std::map<long, Subject> subjects;  // by barcode
  for (const auto& row : table({texts.barcodes, "Barcodes.dat", file}, 2, graph)) {
    if (!(row[0] >= 1.0) || row[0] > 1e6 || std::abs(row[1]) > 1e6) continue;
    const auto number = static_cast<std::size_t>(row[0]);
    subjects[static_cast<long>(row[1])] = {number <= texts.robots.size(), number};
  }
  std::vector<std::vector<std::array<double, 4>>> wheels;
  double start_s = std::numeric_limits<double>::infinity();
  for (std::size_t r = 0; r < texts.robots.size(); ++r) {
    wheels.push_back(table({texts.robots[r].odometry, name_of(r, "Odometry"), file}, 3, graph));
    if (!wheels.back().empty()) start_s = std::min(start_s, wheels.back().front()[0]);
  }
  std::vector<Odometry> odometry;
  for (const auto& rows : wheels) odometry.emplace_back(rows, start_s);
  for (std::size_t r = 0; r < texts.robots.size(); ++r) {
    const Odometry& own = odometry[r];
    if (own.empty() || own.last_second() < own.first_second()) continue;
    add_odometry(r, own, start_s, graph);
    add_truth(r, {texts.robots[r].groundtruth, name_of(r, "Groundtruth"), file}, own, start_s,
              graph);
    const Part seen{texts.robots[r].measurements, name_of(r, "Measurement"), file};
    for_each_row(seen, 4, graph, [&](const auto& row, int line) {
      const auto& [stamp, barcode, range, bearing] = row;
      const auto found =
          std::abs(barcode) < 1e6 ? subjects.find(static_cast<long>(barcode)) : subjects.end();
      const double t = stamp - start_s;
      const auto refuse = [&](const char* what) { complain(graph, file, line, what, seen.name); };
      if (found == subjects.end()) return refuse("a measurement of a barcode that is nobody's");
      if (!(t >= -1.0) || !(t < kMostSeconds)) return refuse("a measurement before the odometry");
      if (!(range > 0.0) || !(range < kFarthest_m) || !(std::abs(bearing) < 10.0))
        return refuse("a range or bearing that cannot be");
      Edge e = sight(r, own, t, range, bearing);
      if (found->second.robot) {
        const std::size_t other = found->second.number - 1;
        const Odometry& theirs = odometry[other];
        const std::uint64_t second = e.a & ((std::uint64_t{1} << 56) - 1);
        if (other == r || theirs.empty() || second < theirs.first_second() ||
            second > theirs.last_second())
          return;
        e.b = robot_id(other, second);
        const Se2 off = theirs.between(static_cast<double>(second), t);  // it moves, too
        const double more = off.x * off.x + off.y * off.y;
        e.information(0, 0) = 1.0 / (1.0 / e.information(0, 0) + more);
        e.information(1, 1) = 1.0 / (1.0 / e.information(1, 1) + more / (range * range));
      } else {
        e.b = symbol('L', found->second.number);
        graph.points.insert(e.b);
      }
      graph.edges.push_back(e);
    });
  }
  for (const auto& row : table({texts.landmarks, "Landmark_Groundtruth.dat", file}, 3, graph)) {
    if (!(row[0] >= 0.0) || row[0] > 1e6) continue;
    graph.truth[symbol('L', static_cast<std::uint64_t>(row[0]))].t = {row[1], row[2], 0.0};
  }
}

}  // namespace maplet::graphs
