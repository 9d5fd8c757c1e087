// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/registration/plane_pairs.hpp"

#include <Eigen/LU>
#include <algorithm>
#include <bit>
#include <cmath>

#include "core/maplet/codec.hpp"

namespace maplet {

namespace {

constexpr double kPartShare = 0.5;  // of a part, on the larger plane
constexpr int kAbove = 1 << 16;     // of the cells beside a grid: what is cut is positive

// Sets every stride-th occupied cell's centre: 64 cells at a time.
void sample(const Maplet& m, PlaneFeature& feature) noexcept {
  const CellGrid& grid = feature.plane->grid;
  if (grid.occupied == 0 || grid.columns == 0) return;
  const double size = m.cell_m_of(grid);
  const std::uint32_t stride = std::max<std::uint32_t>(1, grid.occupied / PlaneFeature::kSamples);
  const std::uint32_t end = grid.first_bit + std::uint32_t{grid.columns} * grid.rows;
  std::uint32_t before = 0;
  std::uint32_t target = stride / 2;
  for (std::uint32_t word = grid.first_bit / 64; word * 64 < end; ++word) {
    std::uint64_t bits = m.cells[word];
    if (word * 64 < grid.first_bit) bits &= ~std::uint64_t{0} << (grid.first_bit % 64);
    if (word * 64 + 64 > end) bits &= ~std::uint64_t{0} >> (word * 64 + 64 - end);
    const auto count = static_cast<std::uint32_t>(std::popcount(bits));
    while (target < before + count) {
      std::uint64_t rest = bits;
      for (std::uint32_t skip = target - before; skip > 0; --skip) rest &= rest - 1;
      const std::uint32_t cell =
          word * 64 + static_cast<std::uint32_t>(std::countr_zero(rest)) - grid.first_bit;
      feature.samples.push_back(
          feature.basis.point((grid.column0 + static_cast<int>(cell % grid.columns) + 0.5) * size,
                              (grid.row0 + static_cast<int>(cell / grid.columns) + 0.5) * size));
      if (full(feature.samples)) return;
      target += stride;
    }
    before += count;
  }
}

// How far cells are from the plane's centre, at most.
double reach_of(const Maplet& m, const PlaneFeature& f) noexcept {
  const CellGrid& grid = f.plane->grid;
  const double size = m.cell_m_of(grid);
  double most = 0.0;
  for (const int column : {0, int{grid.columns}}) {
    for (const int row : {0, int{grid.rows}}) {
      const Eigen::Vector3d corner =
          f.basis.point((grid.column0 + column) * size, (grid.row0 + row) * size);
      most = std::max(most, (corner - f.plane->centre).norm());
    }
  }
  return most;
}

// What decode() lets through is; what a program made itself may be anything.
bool usable(const MapletPlane& p) noexcept {
  return p.plane.n.allFinite() && p.covariance.allFinite() &&
         std::abs(p.plane.d) <= codec::kMaxDistance_m && p.centre.norm() <= codec::kMaxDistance_m;
}

// @param region  or nullptr; T maps m into its frame
double read(const Maplet& m, const RegionOfInterest* region, const Se3& T,
            StaticVector<PlaneFeature, kMaxMapletPlanes>& out) noexcept {
  out.clear();
  double area = 0.0;
  for (const MapletPlane& p : m.planes) {
    if (p.grid.occupied == 0 || !usable(p)) continue;
    if (region != nullptr && !region->touches(m, p, T)) continue;
    PlaneFeature& f = out.emplace_back();
    f.plane = &p;
    f.basis = p.basis();
    f.tangent = {f.basis.u, f.basis.v, p.plane.n, p.centre};
    sample(m, f);
    f.radius_m = reach_of(m, f);
    area += p.area_m2;
  }
  return area;
}

// Whether a surface was seen within `slack` of p; far slack asks the bounding box only.
bool seen_near(const Maplet& m, const CellGrid& grid, const PlaneBasis& basis,
               const Eigen::Vector3d& p, double slack_m) noexcept {
  const double size = m.cell_m_of(grid);
  const Eigen::Vector2d at = basis.coordinates(p) / size - Eigen::Vector2d{grid.column0, grid.row0};
  const double slack = slack_m / size;
  if (!(at.x() > -slack && at.y() > -slack && at.x() < grid.columns + slack &&
        at.y() < grid.rows + slack)) {
    return false;
  }
  if (slack_m > 0.2) return true;
  const auto below = [](double x) { return static_cast<int>(x + kAbove) - kAbove; };
  const int columns[] = {below(at.x()), below(at.x() - slack), below(at.x() + slack)};
  const int rows[] = {below(at.y()), below(at.y() - slack), below(at.y() + slack)};
  for (const int row : rows) {
    if (row < 0 || row >= grid.rows) continue;
    for (const int column : columns) {
      if (column >= 0 && column < grid.columns && m.cell(grid, column, row)) return true;
    }
  }
  return false;
}

}  // namespace

void PlanePairs::prepare(const Maplet& a, const Maplet& b, const RegionOfInterest* region,
                         const Se3& T_a_b) noexcept {
  maplet_a_ = &a;
  maplet_b_ = &b;
  area_a_m2_ = read(a, region, {}, a_);
  area_b_m2_ = read(b, region, T_a_b, b_);
  pairs_.clear();
}

double PlanePairs::worth() const noexcept {
  constexpr double kLargest_m2 = 1.5;
  double sum = 0.0;
  for (const PlanePair& pair : pairs_) sum += std::sqrt(std::min(pair.area_m2, kLargest_m2));
  return sum;
}

double PlanePairs::shared_m2() const noexcept {
  double sum = 0.0;
  for (const PlanePair& pair : pairs_) sum += pair.area_m2;
  const auto add_parts = [&sum](const auto& planes, const auto& best, const auto& best_back,
                                const auto& others) {
    for (std::size_t i = 0; i < planes.size(); ++i) {
      const Best& b = best[i];
      if (b.other < 0 || b.share < kPartShare) continue;
      const auto other = static_cast<std::size_t>(b.other);
      if (best_back[other].other == static_cast<int>(i)) continue;  // a pair
      if (planes[i].plane->area_m2 <= others[other].plane->area_m2)
        sum += b.share * planes[i].plane->area_m2;
    }
  };
  add_parts(a_, best_of_a_, best_of_b_, b_);
  add_parts(b_, best_of_b_, best_of_a_, a_);
  return sum;
}

// b's plane is moved_b_.
void PlanePairs::consider(std::size_t ia, std::size_t ib, double gate_m, double gate_rad,
                          const RegistrationConfig& config) noexcept {
  const PlaneFeature& fa = a_[ia];
  const PlaneFeature& fb = b_[ib];
  // The smaller plane's samples on the larger one.
  const bool b_smaller = fb.plane->area_m2 < fa.plane->area_m2;
  const double slack = std::max(0.5 * gate_m, maplet_a_->cell_m);
  const auto& samples = b_smaller ? moved_b_.samples : fa.samples;
  const auto count = static_cast<double>(std::max<std::size_t>(1, samples.size()));
  const double needed = config.min_extent_overlap * count;
  Eigen::Vector3d middle = Eigen::Vector3d::Zero();
  std::size_t shared = 0;
  std::size_t left = samples.size();
  for (const Eigen::Vector3d& p : samples) {
    if (static_cast<double>(shared + left) < needed) return;
    --left;
    const bool near = b_smaller ? seen_near(*maplet_a_, fa.plane->grid, fa.basis, p, slack)
                                : seen_near(*maplet_b_, fb.plane->grid, moved_b_.basis, p, slack);
    if (!near) continue;
    ++shared;
    middle += p;
  }
  const double share = static_cast<double>(shared) / count;
  if (shared == 0 || share < config.min_extent_overlap) return;
  middle /= static_cast<double>(shared);
  middle -= fa.plane->plane.distance(middle) * fa.plane->plane.n;

  const double off = moved_b_.plane.distance(middle);
  if (std::abs(off) > gate_m) return;
  const double turned = (moved_b_.plane.n - fa.plane->plane.n).norm();
  const double cost =
      (off * off / (gate_m * gate_m) + turned * turned / (gate_rad * gate_rad) + 0.05) /
      share;  // eq. 2
  if (best_of_a_[ia].other < 0 || cost < best_of_a_[ia].cost) {
    best_of_a_[ia] = {static_cast<std::int16_t>(ib), cost, share, middle};
  }
  if (best_of_b_[ib].other < 0 || cost < best_of_b_[ib].cost) {
    best_of_b_[ib] = {static_cast<std::int16_t>(ia), cost, share, middle};
  }
}

void PlanePairs::move_b(const PlaneFeature& b, const Eigen::Matrix3d& R,
                        const Eigen::Vector3d& t) noexcept {
  moved_b_.plane.n = R * b.plane->plane.n;
  moved_b_.plane.d = b.plane->plane.d - moved_b_.plane.n.dot(t);
  moved_b_.basis.foot = R * b.basis.foot + t;
  moved_b_.basis.u = R * b.basis.u;
  moved_b_.basis.v = R * b.basis.v;
  moved_b_.samples.clear();
  for (const Eigen::Vector3d& p : b.samples) moved_b_.samples.push_back(R * p + t);
}

void PlanePairs::match(const Se3& T_a_b, double gate_m, double gate_rad,
                       const RegistrationConfig& config) noexcept {
  pairs_.clear();
  best_of_a_.fill({});
  best_of_b_.fill({});
  const Eigen::Matrix3d R = T_a_b.rotation();
  const double least_cosine = std::cos(std::min(gate_rad, 1.5));
  const double slack = std::max(gate_m, 2.0 * std::max(maplet_a_->cell_m, maplet_b_->cell_m));
  for (std::size_t ib = 0; ib < b_.size(); ++ib) {
    const PlaneFeature& fb = b_[ib];
    const Eigen::Vector3d n = R * fb.plane->plane.n;
    const Eigen::Vector3d centre = R * fb.plane->centre + T_a_b.t;
    bool moved = false;
    for (std::size_t ia = 0; ia < a_.size(); ++ia) {
      const PlaneFeature& fa = a_[ia];
      // n . n tells the seen sides apart too.
      if (n.dot(fa.plane->plane.n) < least_cosine) continue;
      const double apart = (centre - fa.plane->centre).norm();
      if (apart > fa.radius_m + fb.radius_m + slack) continue;
      // With a lever arm the centres may be further off than the planes are.
      if (std::abs(fa.plane->plane.distance(centre)) > gate_m + gate_rad * apart) continue;
      if (!moved) move_b(fb, R, T_a_b.t);
      moved = true;
      consider(ia, ib, gate_m, gate_rad, config);
    }
  }
  for (std::size_t ia = 0; ia < a_.size(); ++ia) {
    const Best& best = best_of_a_[ia];
    if (best.other < 0 || best_of_b_[best.other].other != static_cast<int>(ia)) continue;
    const PlaneFeature& fa = a_[ia];
    const PlaneFeature& fb = b_[best.other];
    PlanePair pair{&fa, &fb, fa.tangent, {}, config.uneven_rad, best.share, 0.0};
    pair.tangent.centre = best.middle;
    pair.area_m2 = best.share * std::min(fa.plane->area_m2, fb.plane->area_m2);
    // A surface that is uneven by so much over so wide a piece.
    pair.uneven_rad = std::min(config.uneven_rad,
                               2.0 * config.uneven_m / std::max(1e-3, std::sqrt(pair.area_m2)));
    const Eigen::Matrix3d change_a = fa.tangent.change_to(pair.tangent);
    const Eigen::Matrix3d change_b = fb.tangent.moved(T_a_b).change_to(pair.tangent);
    Eigen::Matrix3d covariance = change_a * fa.plane->covariance * change_a.transpose() +
                                 change_b * fb.plane->covariance * change_b.transpose();
    covariance.diagonal() +=
        Eigen::Vector3d{pair.uneven_rad, pair.uneven_rad, config.uneven_m}.cwiseAbs2();
    pair.weight = covariance.inverse();  // eq. 4
    pairs_.push_back(pair);
  }
}

}  // namespace maplet
