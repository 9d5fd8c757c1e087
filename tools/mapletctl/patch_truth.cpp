// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "tools/mapletctl/patch_truth.hpp"

#include <fmt/core.h>

#include <filesystem>
#include <fstream>
#include <map>
#include <nlohmann/json.hpp>
#include <vector>

#include "drivers/replay/image_file.hpp"
#include "drivers/sim/sim_source.hpp"
#include "drivers/uri.hpp"
#include "tools/mapletctl/command.hpp"

namespace maplet::ctl {

namespace {

namespace fs = std::filesystem;

class SimTruth final : public PatchTruth {
 public:
  explicit SimTruth(const SimSource& sim) : sim_{sim} {}

  std::span<const std::uint16_t> labels(const DepthFrame&) override {
    T_camera_world_ = sim_.T_world_camera().se3.inverse();
    return sim_.labels();
  }
  std::optional<Plane> plane(std::uint16_t label) const override {
    return T_camera_world_ * sim_.planes()[label - 1U];
  }

 private:
  const SimSource& sim_;
  Se3 T_camera_world_;
};

class RecordedTruth final : public PatchTruth {
 public:
  RecordedTruth(fs::path folder, std::uint64_t first, std::uint64_t every)
      : folder_{std::move(folder)}, first_{first}, every_{every} {
    read_planes();
  }

  std::span<const std::uint16_t> labels(const DepthFrame& frame) override {
    line_ = first_ + frame.index * every_;
    const ImageSize size{frame.depth.width_px, frame.depth.height_px};
    labels_.resize(size.pixels());
    const auto read =
        reader_.read_depth(folder_ / "labels" / fmt::format("{:06}.png", line_), size, labels_);
    if (!read) throw Failure{std::string{view(read.error().what)}};
    return labels_;
  }
  std::optional<Plane> plane(std::uint16_t label) const override {
    const auto frame = planes_.find(line_);
    if (frame == planes_.end()) return std::nullopt;
    const auto found = frame->second.find(label);
    return found == frame->second.end() ? std::nullopt : std::optional{found->second};
  }

 private:
  void read_planes() {
    const fs::path file = folder_ / "planes.jsonl";
    std::ifstream in{file};
    std::string line;
    for (int number = 1; std::getline(in, line); ++number) {
      try {
        const auto json = nlohmann::json::parse(line);
        auto& planes = planes_[json.at("frame").get<std::uint64_t>()];
        for (const auto& p : json.at("planes")) {
          const auto n = p.at("n").get<std::array<double, 3>>();
          const double d = p.at("d").get<double>();
          const double sign = d < 0.0 ? -1.0 : 1.0;  // others may have it either way
          planes[p.at("id").get<std::uint16_t>()] = {{sign * n[0], sign * n[1], sign * n[2]},
                                                     sign * d};
        }
      } catch (const nlohmann::json::exception& error) {
        throw Failure{fmt::format("{}:{}: {}", file.string(), number, error.what())};
      }
    }
  }

  fs::path folder_;
  std::uint64_t first_, every_, line_ = 0;
  std::map<std::uint64_t, std::map<std::uint16_t, Plane>> planes_;
  ImageReader reader_;
  std::vector<std::uint16_t> labels_;
};

}  // namespace

std::unique_ptr<PatchTruth> PatchTruth::of(const std::string& text, const DepthSource& source) {
  if (const auto* sim = dynamic_cast<const SimSource*>(&source)) {
    return std::make_unique<SimTruth>(*sim);
  }
  const auto uri = Uri::parse(text);
  std::error_code error;
  if (!uri || uri->scheme != "tum" || !fs::exists(fs::path{uri->path} / "labels", error)) {
    return nullptr;
  }
  constexpr std::uint64_t kMost = 1U << 30;
  return std::make_unique<RecordedTruth>(uri->path, uri->count("first", 0, 0, kMost).value_or(0),
                                         uri->count("every", 1, 1, kMost).value_or(1));
}

}  // namespace maplet::ctl
