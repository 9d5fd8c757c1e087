// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "tools/files/surface.hpp"

#include "core/maplet/strips.hpp"

namespace maplet::files {

std::vector<Surface> surfaces_of(const Maplet& maplet) {
  std::vector<Surface> surfaces;
  for (const MapletPlane& plane : maplet.planes) {
    Surface surface{plane.plane, plane.area_m2, plane.mean_gray, {}};
    const CellGrid& grid = plane.grid;
    const PlaneBasis basis = plane.basis();
    const double size_m = maplet.cell_m_of(grid);
    for_each_strip(maplet, plane, [&](int column, int row, int cells) {
      surface.strips.push_back(
          {basis.point((grid.column0 + column) * size_m, (grid.row0 + row) * size_m),
           basis.u * (cells * size_m), basis.v * size_m});
    });
    surfaces.push_back(std::move(surface));
  }
  return surfaces;
}

Surface moved(const Se3& T_a_b, const Surface& b) {
  Surface a{T_a_b * b.plane, b.area_m2, b.mean_gray, {}};
  a.strips.reserve(b.strips.size());
  for (const Strip& strip : b.strips) {
    a.strips.push_back({T_a_b * strip.corner, T_a_b.q * strip.along, T_a_b.q * strip.across});
  }
  return a;
}

}  // namespace maplet::files
