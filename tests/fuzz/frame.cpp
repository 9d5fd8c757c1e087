// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <cstring>
#include <memory>
#include <vector>

#include "core/frame/sensor_kind.hpp"
#include "core/patches/extractor.hpp"
#include "tests/fuzz/fuzz.hpp"

namespace {

using namespace maplet;

/// Moves on by one step at each look: where a run is cut depends on the input alone.
class LookClock final : public Clock {
 public:
  [[nodiscard]] Instant now() const noexcept override { return Instant{Duration{1000 * looks_++}}; }

 private:
  mutable std::int64_t looks_ = 0;
};

/// Reads fixed-size values from the front; zeros when the input is over.
class Reader {
 public:
  explicit Reader(std::span<const std::byte> bytes) : bytes_{bytes} {}
  template <class T>
  T take() {
    T value{};
    const std::size_t n = std::min(sizeof value, bytes_.size());
    if (n > 0) std::memcpy(&value, bytes_.data(), n);
    bytes_ = bytes_.subspan(n);
    return value;
  }
  [[nodiscard]] std::span<const std::byte> rest() const { return bytes_; }

 private:
  std::span<const std::byte> bytes_;
};

/// Short inputs make whole frames: their pixels repeat, each time around raised by a slope, so that
/// there are planes in it.
std::vector<std::uint16_t> make_pixels(Reader& in, std::size_t count, int width, int du, int dv) {
  std::vector<std::uint16_t> pixels(count);
  std::vector<std::uint16_t> pattern(std::max<std::size_t>(1, in.rest().size() / 2));
  for (auto& p : pattern) p = in.take<std::uint16_t>();
  for (std::size_t k = 0; k < count; ++k) {
    const int u = static_cast<int>(k) % width;
    const int v = static_cast<int>(k) / width;
    const std::uint16_t raw = pattern[k % pattern.size()];
    pixels[k] = static_cast<std::uint16_t>(raw + (raw == 0 ? 0 : u * du + v * dv));
  }
  return pixels;
}

void check(const DepthFrame& frame, const PatchSet& set, const PatchExtractor& extractor) {
  const int width = frame.depth.width_px;
  const int height = frame.depth.height_px;
  const auto area = static_cast<std::uint32_t>(width * height);
  fuzz::require(set.valid_pixels <= area + area, "no more pixels than there are");
  for (const Patch& p : set.patches) {
    fuzz::require(p.width_px > 0 && p.height_px > 0 && p.u_px + p.width_px <= width &&
                      p.v_px + p.height_px <= height,
                  "a patch lies inside the image");
    fuzz::require(p.theta.allFinite() && p.information.allFinite(), "a patch is finite");
    fuzz::require(p.plane < static_cast<int>(set.planes.size()), "a patch's plane is there");
  }
  for (const FramePlane& p : set.planes) {
    fuzz::require(p.theta.allFinite() && p.information.allFinite(), "a plane is finite");
    fuzz::require(p.area_m2 >= 0.0F && p.rms_m >= 0.0F, "area and residual make sense");
  }
  for (int v = 0; v < height; v += 3) {
    for (int u = 0; u < width; u += 3) (void)set.plane_at(u, v);
  }
  std::vector<std::uint16_t> labels(area);
  extractor.write_labels(frame, labels);
  for (const std::uint16_t label : labels) {
    fuzz::require(label <= set.planes.size(), "a label is a plane's");
  }
}

}  // namespace

// A frame from anywhere: any size, stride, unit, intrinsics, noise model, pixels, and a deadline
// that passes anywhere.
int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  struct Stage {
    Arena arena;
    PatchExtractor extractor{PatchConfig{}, arena};
  };
  static const auto stage = std::make_unique<Stage>();
  Reader in{fuzz::bytes(data, size)};
  const int width = in.take<std::uint16_t>() % 200;
  const int height = in.take<std::uint16_t>() % 150;
  const int pad = in.take<std::uint8_t>() % 32;
  const auto flags = in.take<std::uint8_t>();
  const auto looks = in.take<std::uint8_t>();
  const int du = in.take<std::int8_t>();
  const int dv = in.take<std::int8_t>();
  DepthFrame frame;
  frame.camera = {
      width, height, in.take<double>(), in.take<double>(), in.take<double>(), in.take<double>()};
  frame.metres_per_unit = in.take<double>();
  frame.noise = typical_noise(static_cast<SensorKind>(flags % 3));
  if ((flags & 8) != 0) frame.noise.disparity_k = in.take<double>();
  if ((flags & 16) != 0) frame.noise.correlated_px = in.take<double>();
  if ((flags & 128) != 0) {
    frame.noise.lateral_px = in.take<double>();
    frame.noise.disparity_step = in.take<double>();
  }

  // Exactly as many pixels as the view says: a sanitizer sees a read beyond them.
  const int stride = width + pad;
  const auto count = static_cast<std::size_t>(height == 0 ? 0 : (height - 1) * stride + width);
  const auto pixels = make_pixels(in, count, std::max(1, stride), du, dv);
  frame.depth = {pixels.data(), width, height, stride};
  std::vector<std::uint8_t> gray(count, 128);
  if ((flags & 32) != 0) frame.gray = {gray.data(), width, height, stride};

  const LookClock clock;
  const Deadline deadline =
      (flags & 64) != 0 ? Deadline{clock, Duration{1000 * looks}} : Deadline::never();
  check(frame, stage->extractor.run(frame, deadline), stage->extractor);
  return 0;
}
