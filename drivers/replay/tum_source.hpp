// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <filesystem>
#include <limits>
#include <optional>
#include <string>
#include <vector>

#include "core/ports/depth_source.hpp"
#include "drivers/replay/camera_toml.hpp"
#include "drivers/replay/image_file.hpp"
#include "drivers/replay/motion_files.hpp"
#include "drivers/source.hpp"

namespace maplet {

/// Which lines of depth.txt are played: count of them, from the first, every n-th.
struct TumSelection {
  std::uint64_t first = 0;
  std::uint64_t count = std::numeric_limits<std::uint64_t>::max();
  std::uint64_t every = 1;
};

/// A recording in TUM RGB-D layout: depth.txt with 16-bit PNGs, optionally rgb.txt with colour or
/// gray images, camera.toml beside them (else the camera of SourceOptions).
///
/// A frame's index is its place in the selection: skipped frames leave gaps. An image that cannot
/// be read, a line that makes no sense and a stamp out of order are counted and skipped: played are
/// the most frames whose stamps go forward, so that one wrong stamp costs one frame. Gray is the
/// image nearest in time, at most kGrayTolerance off, and only where camera.toml says that it is
/// registered to depth, or where its camera stands to the depth camera (table [gray]). Beside it
/// may stand odometry.txt and gyro.txt (MotionFiles).
///
/// Memory  the lists and one image of each kind, decided in open(); libjpeg-turbo's own for gray.
/// Time    one decoding a frame; expired deadlines are noticed between skipped frames.
class TumSource final : public DepthSource {
 public:
  static constexpr Duration kGrayTolerance = std::chrono::milliseconds{20};

  /// Reads the lists, and images up to the first good one: what fits none of them is an error here.
  [[nodiscard]] static OpenedSource open(const std::filesystem::path& folder,
                                         const TumSelection& selection,
                                         const SourceOptions& options);

  [[nodiscard]] Expected<DepthFrame> next(Deadline deadline) noexcept override;
  [[nodiscard]] SourceCounters counters() const noexcept override { return counters_; }
  [[nodiscard]] std::string_view detail() const noexcept override { return view(detail_); }
  /// Selected lines of depth.txt: delivered frames and skipped ones.
  [[nodiscard]] std::optional<std::uint64_t> length() const noexcept override {
    return entries_.size();
  }
  [[nodiscard]] std::optional<ImageSize> size() const noexcept override {
    return ImageSize{frame_.camera.width_px, frame_.camera.height_px};
  }

 private:
  struct Entry {
    std::filesystem::path depth;  ///< empty: the line cannot be understood
    std::filesystem::path gray;   ///< empty: there is none
    Stamp stamp{};
    int line = 0;
    bool in_order = false;
  };
  using Problem = tl::unexpected<std::string>;

  TumSource() = default;
  tl::expected<void, std::string> read_camera(const SourceOptions& options);
  tl::expected<void, std::string> read_list(const TumSelection& selection);
  tl::expected<void, std::string> add_gray();
  tl::expected<void, std::string> check_images();
  bool load(const Entry& entry) noexcept;
  [[nodiscard]] double middle_depth_m() const;
  [[nodiscard]] ImageSize gray_size() const noexcept {
    const CameraModel& camera = gray_camera_ ? gray_camera_->camera : frame_.camera;
    return {camera.width_px, camera.height_px};
  }

  std::filesystem::path folder_;
  std::vector<Entry> entries_;
  std::size_t next_ = 0;
  bool registered_ = false;
  std::optional<RecordedGray> gray_camera_;  ///< of a gray camera that is not the depth camera
  MotionFiles motion_;
  InvalidValues invalid_values_;
  DepthFrame frame_;  ///< what all frames share
  ImageReader reader_;
  std::vector<std::uint16_t> depth_;
  std::vector<std::uint8_t> gray_;  ///< empty: none wanted or none there
  bool gray_loaded_ = false;
  SourceCounters counters_;
  Line detail_;
};

}  // namespace maplet
