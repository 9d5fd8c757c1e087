// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include <filesystem>
#include <fstream>
#include <iterator>
#include <stdexcept>

#include "tools/solve/graph_file.hpp"

namespace maplet::graphs {
namespace {

namespace fs = std::filesystem;

std::string slurp(const fs::path& path) {
  std::ifstream in{path, std::ios::binary};
  if (!in) throw std::runtime_error{path.string() + ": cannot be opened"};
  std::string text{std::istreambuf_iterator<char>{in}, {}};
  if (in.bad()) throw std::runtime_error{path.string() + ": cannot be read"};
  return text;
}

std::string slurp_if_there(const fs::path& path) {
  return fs::exists(path) ? slurp(path) : std::string{};
}

MrclamTexts read_folder(const fs::path& folder) {
  constexpr int kMostRobots = 20;
  MrclamTexts texts;
  if (!fs::exists(folder / "Barcodes.dat") || !fs::exists(folder / "Robot1_Odometry.dat"))
    throw std::runtime_error{folder.string() +
                             ": a folder without Barcodes.dat and Robot1_Odometry.dat is no MRCLAM "
                             "data set; name that folder, or g2o or .pyfg files"};
  texts.barcodes = slurp(folder / "Barcodes.dat");
  texts.landmarks = slurp_if_there(folder / "Landmark_Groundtruth.dat");
  for (int r = 1; r <= kMostRobots; ++r) {
    const std::string robot = "Robot" + std::to_string(r);
    if (!fs::exists(folder / (robot + "_Odometry.dat"))) break;
    texts.robots.push_back({slurp(folder / (robot + "_Odometry.dat")),
                            slurp(folder / (robot + "_Measurement.dat")),
                            slurp_if_there(folder / (robot + "_Groundtruth.dat"))});
  }
  return texts;
}

}  // namespace

void read_graph(const std::string& path, int file, GraphFile& graph) {
  if (fs::is_directory(path)) {
    read_mrclam(read_folder(path), file, graph);
  } else if (fs::path{path}.extension() == ".pyfg") {
    read_pyfg(slurp(path), file, graph);
  } else {
    read_g2o(slurp(path), file, graph);
  }
}

}  // namespace maplet::graphs
