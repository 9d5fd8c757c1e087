// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <filesystem>
#include <fstream>
#include <string>
#include <string_view>
#include <tl/expected.hpp>

#include "core/frame/depth_frame.hpp"
#include "core/geometry/se3.hpp"
#include "drivers/replay/camera_toml.hpp"

namespace maplet {

/// Writes a recording in TUM RGB-D layout: what `tum:DIR` reads, with the same pixels and stamps.
///
/// depth.txt, depth/NNNNNN.png (16 bit), rgb.txt and rgb/NNNNNN.png (8-bit gray, lossless) when
/// frames have gray, camera.toml, groundtruth.txt when poses are given. NNNNNN counts from 0.
/// A folder that holds a recording of our own is made anew; anything else is left alone.
///
/// Memory   allocates. Every error is one line with the file's name.
class TumWriter {
 public:
  using Done = tl::expected<void, std::string>;

  /// @param title  first line of each list, behind "# mapletctl "
  [[nodiscard]] static tl::expected<TumWriter, std::string> create(
      const std::filesystem::path& folder, const RecordedCamera& camera, std::string_view title);

  [[nodiscard]] Done write(const DepthFrame& frame);
  [[nodiscard]] Done write_pose(Stamp stamp, const Se3& T_world_camera);
  /// Another image of the last frame written, for example `labels`: NAME/NNNNNN.png.
  [[nodiscard]] Done write_beside(std::string_view name, const ImageView<std::uint16_t>& image);
  /// Of the images so far.
  [[nodiscard]] std::uint64_t bytes() const noexcept { return bytes_; }
  /// Everything is on its way to the disk, or why not.
  [[nodiscard]] Done finish();

 private:
  struct List {
    std::filesystem::path file;
    std::ofstream stream;
  };

  TumWriter(const std::filesystem::path& folder, std::string_view title)
      : folder_{folder}, title_{title} {}
  template <class Image>
  Done write_image(const std::filesystem::path& file, const Image& image);
  Done open(List& list, std::string_view name, std::string_view columns);
  Done write_camera(const RecordedCamera& camera);

  std::filesystem::path folder_;
  std::string title_;
  List depth_, gray_, poses_;
  std::string image_;  ///< NNNNNN.png of the last frame
  std::uint64_t count_ = 0;
  std::uint64_t bytes_ = 0;
};

}  // namespace maplet
