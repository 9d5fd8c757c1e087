// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <libcamera/camera.h>
#include <libcamera/framebuffer_allocator.h>

#include <atomic>
#include <cstdint>
#include <map>
#include <memory>
#include <span>
#include <string>
#include <tl/expected.hpp>
#include <vector>

#include "drivers/gray_camera.hpp"
#include "drivers/gray_ring.hpp"
#include "drivers/libcamera/luma.hpp"

namespace maplet::camera {

/// One open camera whose images go into a ring.
///
/// Memory   the camera's buffers, mapped at open(). Threads  libcamera's write the ring.
class GrayStream {
 public:
  GrayStream(std::shared_ptr<libcamera::Camera> camera, GrayRing& ring,
             const GrayCameraOptions& options);
  ~GrayStream();
  GrayStream(const GrayStream&) = delete;
  GrayStream& operator=(const GrayStream&) = delete;

  /// @return why it does not work; else "ID: 640x480 NV12, ..."
  [[nodiscard]] tl::expected<std::string, std::string> open();
  [[nodiscard]] bool gone() const noexcept { return gone_; }
  [[nodiscard]] std::uint64_t damaged() const noexcept { return damaged_; }

 private:
  using Done = tl::expected<void, std::string>;
  Done configure();
  Done map_buffers();
  Done queue_all();
  [[nodiscard]] libcamera::ControlList controls(std::string& said) const;
  void completed(libcamera::Request* request);
  void lost() { gone_ = true; }

  struct Mapping {
    void* memory = nullptr;
    std::size_t bytes = 0;
  };
  std::shared_ptr<libcamera::Camera> camera_;
  GrayRing& ring_;
  const GrayCameraOptions options_;
  std::unique_ptr<libcamera::CameraConfiguration> configuration_;
  std::unique_ptr<libcamera::FrameBufferAllocator> buffers_;
  std::vector<std::unique_ptr<libcamera::Request>> requests_;
  std::vector<Mapping> mappings_;
  std::map<const libcamera::FrameBuffer*, std::span<const std::uint8_t>> planes_;
  LumaLayout layout_;
  std::size_t stride_bytes_ = 0;
  bool acquired_ = false;
  bool started_ = false;
  std::atomic<bool> gone_{false};
  std::atomic<std::uint64_t> damaged_{0};
};

}  // namespace maplet::camera
