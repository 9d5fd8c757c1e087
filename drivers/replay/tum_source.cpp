// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "drivers/replay/tum_source.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cmath>
#include <iterator>

#include "drivers/replay/camera_toml.hpp"
#include "drivers/replay/text.hpp"

namespace maplet {

namespace {

constexpr std::size_t kMaxListBytes = std::size_t{64} << 20;  // 2 M lines: 18 h at 30 Hz
constexpr double kFarthestMiddleM = 100.0;  // of an image: beyond any depth camera
constexpr std::size_t kMaxTomlBytes = std::size_t{1} << 20;

ImageSize size_of(const CameraModel& camera) { return {camera.width_px, camera.height_px}; }

/// The listed image nearest to `stamp`; of two equally near ones the earlier.
const ListedImage* nearest(const std::vector<ListedImage>& sorted, Stamp stamp,
                           Duration tolerance) {
  const auto after = std::lower_bound(
      sorted.begin(), sorted.end(), stamp,
      [](const ListedImage& image, Stamp wanted) { return *image.stamp < wanted; });
  const ListedImage* best = nullptr;
  Duration best_off = tolerance;
  if (after != sorted.begin() && stamp - *std::prev(after)->stamp <= best_off) {
    best = &*std::prev(after);
    best_off = stamp - *best->stamp - Duration{1};
  }
  if (after != sorted.end() && *after->stamp - stamp <= best_off) best = &*after;
  return best;
}

/// Which stamps to play: the most that go forward one after the other. A single wrong one falls
/// out, wherever it points; of equally many the ones with the earlier stamps.
std::vector<bool> forward(const std::vector<std::optional<Stamp>>& stamps) {
  std::vector<std::size_t>
      ends;  // of the best rows so far, by their length: the smallest last stamp
  std::vector<std::size_t> before(stamps.size(), stamps.size());
  for (std::size_t i = 0; i < stamps.size(); ++i) {
    if (!stamps[i]) continue;
    const auto at =
        std::lower_bound(ends.begin(), ends.end(), *stamps[i],
                         [&](std::size_t end, Stamp stamp) { return *stamps[end] < stamp; });
    if (at != ends.begin()) before[i] = *std::prev(at);
    if (at == ends.end()) {
      ends.push_back(i);
    } else {
      *at = i;
    }
  }
  std::vector<bool> kept(stamps.size(), false);
  for (std::size_t i = ends.empty() ? stamps.size() : ends.back(); i < stamps.size();
       i = before[i]) {
    kept[i] = true;
  }
  return kept;
}

}  // namespace

OpenedSource TumSource::open(const std::filesystem::path& folder, const TumSelection& selection,
                             const SourceOptions& options) {
  const auto bad = [](std::string what) {
    return source_error(SourceError::Kind::kBad, std::move(what));
  };
  std::error_code error;
  const auto status = std::filesystem::status(folder, error);
  if (!std::filesystem::is_directory(status)) {
    return bad(fmt::format("tum: {}: {}; give the folder that holds depth.txt", folder.string(),
                           error ? error.message() : "not a folder"));
  }
  std::unique_ptr<TumSource> source{new TumSource};
  source->folder_ = folder;
  if (auto read = source->read_camera(options); !read) return bad(read.error());
  if (auto read = source->read_list(selection); !read) return bad(read.error());
  if (options.gray) {
    if (auto added = source->add_gray(); !added) return bad(added.error());
  }
  auto motion = MotionFiles::read(folder);
  if (!motion) return bad(motion.error());
  source->motion_ = std::move(*motion);
  if (source->motion_.skipped() > 0) {
    source->detail_ =
        line("{}: {}: skipped", folder.c_str(), source->motion_.skipped_where().c_str());
  }
  if (auto fit = source->check_images(); !fit) return bad(fit.error());
  return source;
}

tl::expected<void, std::string> TumSource::read_camera(const SourceOptions& options) {
  const std::filesystem::path file = folder_ / "camera.toml";
  std::error_code error;
  frame_.noise = options.noise;
  if (std::filesystem::exists(file, error) || error) {
    const auto text = read_text(file, kMaxTomlBytes);
    if (!text) return Problem{text.error()};
    const auto recorded = parse_camera_toml(*text, file.string());
    if (!recorded) return Problem{recorded.error()};
    frame_.camera = recorded->camera;
    frame_.metres_per_unit = recorded->metres_per_unit;
    invalid_values_ = recorded->invalid_values;
    registered_ = recorded->registered_to_colour;
    const auto gray = parse_gray_toml(*text, file.string());
    if (!gray) return Problem{gray.error()};
    if (!registered_) gray_camera_ = *gray;
  } else {
    if (!options.camera.valid()) {
      return Problem{fmt::format(
          "{}: no such file, and the configuration has no camera: add it, or set camera.width_px "
          "height_px fx_px fy_px cx_px cy_px metres_per_unit",
          file.string())};
    }
    frame_.camera = options.camera;
    frame_.metres_per_unit = options.metres_per_unit;
    invalid_values_ = options.invalid_values;
    registered_ = options.registered_to_colour;
  }
  depth_.resize(size_of(frame_.camera).pixels());
  return {};
}

tl::expected<void, std::string> TumSource::read_list(const TumSelection& selection) {
  const std::filesystem::path file = folder_ / "depth.txt";
  const auto text = read_text(file, kMaxListBytes);
  if (!text) return Problem{text.error() + "; it lists stamp and image, one frame a line"};
  const auto images = parse_image_list(*text);
  const auto good = [](const ListedImage& image) { return image.stamp.has_value(); };
  if (std::none_of(images.begin(), images.end(), good)) {
    return images.empty()
               ? Problem{fmt::format("{}: lists no frames: the recording is empty", file.string())}
               : Problem{fmt::format("{}:{}: expected 'stamp file', one frame a line",
                                     file.string(), images.front().line)};
  }
  if (selection.first >= images.size()) {
    return Problem{fmt::format("{}: lists {} frames, none is left from first={}", file.string(),
                               images.size(), selection.first)};
  }
  for (std::uint64_t i = selection.first; i < images.size() && entries_.size() < selection.count;) {
    const ListedImage& image = images[static_cast<std::size_t>(i)];
    Entry entry;
    entry.line = image.line;
    if (image.stamp) {
      entry.stamp = *image.stamp;
      entry.depth = folder_ / image.file;
    }
    entries_.push_back(std::move(entry));
    if (selection.every > images.size()) break;  // also: no overflow
    i += selection.every;
  }
  std::vector<std::optional<Stamp>> stamps;
  for (const Entry& entry : entries_) {
    stamps.push_back(entry.depth.empty() ? std::nullopt : std::optional{entry.stamp});
  }
  const std::vector<bool> kept = forward(stamps);
  for (std::size_t i = 0; i < entries_.size(); ++i) entries_[i].in_order = kept[i];
  return {};
}

tl::expected<void, std::string> TumSource::add_gray() {
  const std::filesystem::path file = folder_ / "rgb.txt";
  std::error_code error;
  if (!std::filesystem::exists(file, error) && !error) return {};
  if (!registered_ && !gray_camera_) {
    detail_ = line(
        "{}: gray is not used: not registered to depth, and camera.toml has no [gray] T_depth_gray",
        folder_.c_str());
    return {};
  }
  const Duration offset{gray_camera_ ? std::llround(1e9 * gray_camera_->time_offset_s)
                                     : Duration::rep{0}};
  const auto text = read_text(file, kMaxListBytes);
  if (!text) return Problem{text.error() + "; to do without gray: input.gray=off"};
  auto images = parse_image_list(*text);
  const auto useless = [](const ListedImage& image) { return !image.stamp.has_value(); };
  counters_.unreadable += std::erase_if(images, useless);
  std::stable_sort(images.begin(), images.end(),
                   [](const auto& a, const auto& b) { return *a.stamp < *b.stamp; });
  bool any = false;
  for (Entry& entry : entries_) {
    if (entry.depth.empty()) continue;
    if (const ListedImage* image = nearest(images, entry.stamp + offset, kGrayTolerance)) {
      entry.gray = folder_ / image->file;
      any = true;
    }
  }
  if (any) gray_.resize(gray_size().pixels());
  return {};
}

tl::expected<void, std::string> TumSource::check_images() {
  const ImageSize want = size_of(frame_.camera);
  const ImageSize want_gray = gray_size();
  const auto differs = [](const std::filesystem::path& file,
                          const ImageReader::Result<ImageSize>& got, ImageSize expected) {
    return fmt::format(
        "{}: image is {}x{}, camera.toml or the configuration says {}x{}: correct it",
        file.string(), got->width_px, got->height_px, expected.width_px, expected.height_px);
  };
  std::string first_problem;
  for (const Entry& entry : entries_) {
    if (entry.depth.empty()) continue;
    if (const auto size = reader_.read_size(entry.depth); size && *size != want) {
      return Problem{differs(entry.depth, size, want)};
    }
    const auto read = reader_.read_depth(entry.depth, want, depth_);
    if (!read) {
      if (first_problem.empty()) first_problem.assign(read.error().what.data());
      continue;
    }
    const auto gray = entry.gray.empty() ? ImageReader::Result<ImageSize>{want_gray}
                                         : reader_.read_size(entry.gray);
    if (gray && *gray != want_gray) {
      return Problem{differs(entry.gray, gray, want_gray) + ", or set input.gray=off"};
    }
    if (const double middle = middle_depth_m(); middle > kFarthestMiddleM) {
      return Problem{fmt::format(
          "{}: half of its pixels are farther than {:.0f} m: correct metres_per_unit = {} "
          "(camera.toml or the configuration)",
          entry.depth.string(), middle, frame_.metres_per_unit)};
    }
    return {};
  }
  return Problem{fmt::format("{}: no depth image can be read, copy the recording again: {}",
                             (folder_ / "depth.txt").string(),
                             first_problem.empty() ? "none is listed" : first_problem)};
}

/// Of the image in depth_; 0 when nothing is valid.
double TumSource::middle_depth_m() const {
  std::vector<std::uint16_t> valid;
  std::ranges::copy_if(depth_, std::back_inserter(valid), [this](std::uint16_t raw) {
    return raw != 0 && std::ranges::find(invalid_values_, raw) == invalid_values_.end();
  });
  if (valid.empty()) return 0.0;
  const auto middle = valid.begin() + static_cast<std::ptrdiff_t>(valid.size() / 2);
  std::ranges::nth_element(valid, middle);
  return *middle * frame_.metres_per_unit;
}

bool TumSource::load(const Entry& entry) noexcept {
  const ImageSize size = size_of(frame_.camera);
  if (const auto read = reader_.read_depth(entry.depth, size, depth_); !read) {
    detail_ = read.error().what;
    return false;
  }
  for (const std::uint16_t invalid : invalid_values_) {
    std::replace(depth_.begin(), depth_.end(), invalid, std::uint16_t{0});
  }
  gray_loaded_ = false;
  if (entry.gray.empty()) return true;
  if (const auto read = reader_.read_gray(entry.gray, gray_size(), gray_)) {
    gray_loaded_ = true;
  } else {
    detail_ = read.error().what;
    ++counters_.unreadable;  // the image; the frame goes on without it
  }
  return true;
}

Expected<DepthFrame> TumSource::next(Deadline deadline) noexcept {
  for (; next_ < entries_.size(); ++next_) {
    const Entry& entry = entries_[next_];
    const auto skip = [&](std::string_view why) {
      detail_ = line("{}/depth.txt:{}: {}", folder_.c_str(), entry.line, why);
    };
    if (entry.depth.empty()) {
      ++counters_.unreadable;
      skip("expected 'stamp file'");
    } else if (!entry.in_order) {
      ++counters_.out_of_order;
      skip("stamp is out of order");
    } else if (!load(entry)) {
      ++counters_.unreadable;
    } else {
      break;
    }
    if (deadline.expired()) {
      ++next_;
      return fail(ErrorCode::kTimeout, "skipped damaged frames");
    }
  }
  if (next_ == entries_.size()) return fail(ErrorCode::kEnd, "recording is over");
  const Entry& entry = entries_[next_];
  const CameraModel& camera = frame_.camera;
  frame_.index = next_++;
  frame_.stamp = entry.stamp;
  frame_.depth = {depth_.data(), camera.width_px, camera.height_px, camera.width_px};
  frame_.gray = {};
  frame_.gray_beside = {};
  if (gray_loaded_) {
    const ImageSize size = gray_size();
    const ImageView<std::uint8_t> gray{gray_.data(), size.width_px, size.height_px, size.width_px};
    if (gray_camera_) {
      frame_.gray_beside = {gray, gray_camera_->camera, gray_camera_->T_depth_gray};
    } else {
      frame_.gray = gray;
    }
  }
  frame_.motion = motion_.at(entry.stamp);
  ++counters_.read;
  return frame_;
}

}  // namespace maplet
