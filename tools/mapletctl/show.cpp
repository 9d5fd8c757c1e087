// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include <fmt/core.h>

#include <memory>
#include <nlohmann/json.hpp>

#include "core/registration/saliency.hpp"
#include "tools/files/maplet_file.hpp"
#include "tools/mapletctl/command.hpp"

namespace maplet::ctl {
namespace {

using Json = nlohmann::ordered_json;

Json pose_json(const Se3& T) {
  return {T.t.x(), T.t.y(), T.t.z(), T.q.x(), T.q.y(), T.q.z(), T.q.w()};
}

double saliency_of(const Maplet& m) { return std::make_unique<Saliency>()->of(m); }

void print_json(const Maplet& m, std::size_t bytes) {
  Json keyframes = Json::array();
  for (const MapletKeyframe& k : m.keyframes) {
    keyframes.push_back(
        {{"stamp_s", seconds(k.stamp)}, {"T_maplet_camera", pose_json(k.T_maplet_camera.se3)}});
  }
  Json planes = Json::array();
  for (const MapletPlane& p : m.planes) {
    const Eigen::Vector3d sigma = p.covariance.diagonal().cwiseSqrt();
    Json plane{{"id", p.id},
               {"n", {p.plane.n.x(), p.plane.n.y(), p.plane.n.z()}},
               {"d", p.plane.d},
               {"area_m2", p.area_m2},
               {"cells", p.grid.occupied},
               {"cell_m", m.cell_m_of(p.grid)},
               {"centre", {p.centre.x(), p.centre.y(), p.centre.z()}},
               {"sigma_rad", {sigma[0], sigma[1]}},
               {"sigma_m", sigma[2]},
               {"observations", p.observations}};
    plane["mean_gray"] = p.mean_gray < 0.0F ? Json{} : Json{p.mean_gray};
    planes.push_back(std::move(plane));
  }
  const Json line{{"agent", m.key.agent},
                  {"epoch", m.key.epoch},
                  {"id", m.key.id},
                  {"stamp_s", seconds(m.stamp)},
                  {"bytes", bytes},
                  {"complete", m.complete},
                  {"up", m.up.isZero() ? Json{} : Json{m.up.x(), m.up.y(), m.up.z()}},
                  {"saliency", saliency_of(m)},
                  {"keyframes", keyframes},
                  {"planes", planes}};
  fmt::print("{}\n", line.dump());
}

void print_table(const Maplet& m, std::size_t bytes) {
  double area = 0.0;
  for (const MapletPlane& p : m.planes) area += p.area_m2;
  fmt::print("maplet {} of agent {} (epoch {:08x}), origin at {:.3f} s\n", m.key.id, m.key.agent,
             m.key.epoch, seconds(m.stamp));
  fmt::print("{} bytes{}, {} keyframes over {:.2f} s, {} planes, {:.2f} m2, saliency {:.2f}\n",
             bytes, m.complete ? "" : " (the first layers only)", m.keyframes.size(),
             seconds(m.keyframes.back().stamp - m.stamp), m.planes.size(), area, saliency_of(m));
  if (m.up.isZero()) {
    fmt::print("which way is up is not known\n\n");
  } else {
    fmt::print("up is {:.4f} {:.4f} {:.4f}\n\n", m.up.x(), m.up.y(), m.up.z());
  }
  fmt::print("{:>4} {:>24} {:>9} {:>8} {:>7} {:>5} {:>9} {:>9}\n", "id", "normal", "d m", "area m2",
             "cells", "seen", "tilt mrad", "offset mm");
  for (const MapletPlane& p : m.planes) {
    const Eigen::Vector3d sigma = p.covariance.diagonal().cwiseSqrt();
    fmt::print("{:>4} {:>8.4f}{:>8.4f}{:>8.4f} {:>9.4f} {:>8.3f} {:>7} {:>5} {:>9.2f} {:>9.2f}\n",
               p.id, p.plane.n.x(), p.plane.n.y(), p.plane.n.z(), p.plane.d, p.area_m2,
               p.grid.occupied, p.observations, 1e3 * std::max(sigma[0], sigma[1]), 1e3 * sigma[2]);
  }
}

}  // namespace

void add_show(Command app) {
  struct Options {
    std::string file;
    bool json = false;
  };
  auto options = std::make_shared<Options>();
  const Command command = app.add_command("show", "Prints what a .maplet file holds");
  command.add_option("file", options->file, "NNNN.maplet, as mapletd --out writes")
      .required()
      .type_name("FILE");
  command.add_flag("--json", options->json, "One line of JSON");
  command.footer(
      "Examples:\n"
      "  mapletctl show out/run/maplets/0007.maplet            planes, keyframes, bytes of each "
      "layer\n"
      "  mapletctl show --json out/run/maplets/0007.maplet | jq .planes");
  command.run([options] {
    const auto maplet = files::read_maplet(options->file);
    const std::size_t bytes = files::read_bytes(options->file).size();
    options->json ? print_json(*maplet, bytes) : print_table(*maplet, bytes);
  });
}

}  // namespace maplet::ctl
