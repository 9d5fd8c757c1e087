// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// A gray camera that is looked for until it is there, and again when it is gone.
#include <fmt/format.h>
#include <libcamera/camera_manager.h>
#include <libcamera/logging.h>
#include <libcamera/property_ids.h>

#include <condition_variable>
#include <mutex>
#include <thread>

#include "drivers/libcamera/gray_stream.hpp"

namespace maplet {

namespace {

using std::chrono::seconds;

/// One for the life of the process, as libcamera wants it; started when somebody needs it.
libcamera::CameraManager* manager() {
  static const std::unique_ptr<libcamera::CameraManager> only = [] {
    libcamera::logSetTarget(libcamera::LoggingTargetNone);  // what matters is said by us
    auto made = std::make_unique<libcamera::CameraManager>();
    if (made->start() != 0) made.reset();
    return made;
  }();
  return only.get();
}

class LibcameraGray final : public GrayCamera {
 public:
  explicit LibcameraGray(const GrayCameraOptions& options)
      : options_{options},
        ring_{static_cast<std::size_t>(options.camera.width_px) *
              static_cast<std::size_t>(options.camera.height_px)},
        thread_{[this] { loop(); }} {}

  ~LibcameraGray() override {
    {
      const std::scoped_lock lock{mutex_};
      stop_ = true;
    }
    stopped_.notify_all();
    thread_.join();
  }

  std::optional<Instant> nearest(Instant at, Duration tolerance, Duration patience,
                                 std::span<std::uint8_t> to) noexcept override {
    return ring_.nearest(at, tolerance, patience, to);
  }
  bool running() const noexcept override { return running_; }
  std::uint64_t images() const noexcept override { return ring_.images(); }
  Line state() const noexcept override {
    const std::scoped_lock lock{mutex_};
    return state_;
  }

 private:
  static constexpr auto kLook = seconds{1};
  static constexpr int kSilentLooks = 5;  ///< without an image: it is opened anew

  void loop() {
    std::unique_ptr<camera::GrayStream> stream;
    std::uint64_t seen = 0;
    int silent = 0;
    while (!stop()) {
      if (!stream) {
        stream = open();
        silent = 0;
      }
      wait();
      const std::uint64_t images = ring_.images();
      silent = images == seen ? silent + 1 : 0;
      seen = images;
      if (!stream || (!stream->gone() && silent < kSilentLooks)) continue;
      say(stream->gone() ? "the gray camera is gone: depth goes on alone"
                         : "the gray camera sends no images: depth goes on alone");
      running_ = false;
      stream.reset();
      ring_.clear();
    }
    running_ = false;
  }

  std::unique_ptr<camera::GrayStream> open() {
    const auto there =
        manager() ? manager()->cameras() : std::vector<std::shared_ptr<libcamera::Camera>>{};
    std::shared_ptr<libcamera::Camera> found;
    std::string ids;
    for (const auto& camera : there) {
      ids += (ids.empty() ? "" : ", ") + camera->id();
      if (!found && (options_.id.empty() || camera->id() == options_.id)) found = camera;
    }
    if (!found) {
      say(there.empty() ? "libcamera finds no camera: depth goes on alone"
                        : fmt::format("libcamera finds no camera '{}', but {}: depth goes on alone",
                                      options_.id, ids));
      return nullptr;
    }
    auto stream = std::make_unique<camera::GrayStream>(found, ring_, options_);
    const auto opened = stream->open();
    if (!opened) {
      say("gray camera " + opened.error() + ": depth goes on alone");
      return nullptr;
    }
    say("gray camera " + *opened);
    running_ = true;
    return stream;
  }

  void say(const std::string& text) {
    const std::scoped_lock lock{mutex_};
    state_ = line("{}", text);
  }
  [[nodiscard]] bool stop() const {
    const std::scoped_lock lock{mutex_};
    return stop_;
  }
  void wait() {
    std::unique_lock lock{mutex_};
    stopped_.wait_for(lock, kLook, [this] { return stop_; });
  }

  const GrayCameraOptions options_;
  GrayRing ring_;
  std::atomic<bool> running_{false};
  mutable std::mutex mutex_;  ///< guards what follows
  std::condition_variable stopped_;
  Line state_;
  bool stop_ = false;
  std::thread thread_;  ///< last: it uses the rest
};

}  // namespace

tl::expected<std::unique_ptr<GrayCamera>, std::string> open_libcamera(
    const GrayCameraOptions& options) {
  return std::make_unique<LibcameraGray>(options);
}

tl::expected<std::vector<std::string>, std::string> libcamera_cameras() {
  if (manager() == nullptr) return tl::unexpected<std::string>{"libcamera does not start"};
  std::vector<std::string> cameras;
  for (const auto& camera : manager()->cameras()) {
    const auto model = camera->properties().get(libcamera::properties::Model);
    cameras.push_back(model ? fmt::format("{} ({})", camera->id(), *model) : camera->id());
  }
  return cameras;
}

}  // namespace maplet
