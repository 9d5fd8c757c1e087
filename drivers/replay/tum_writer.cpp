// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "drivers/replay/tum_writer.hpp"

#include <fmt/format.h>

#include "drivers/replay/image_file.hpp"
#include "drivers/replay/text.hpp"

namespace maplet {
namespace {

using Problem = tl::unexpected<std::string>;
namespace fs = std::filesystem;

constexpr std::string_view kOurs = "# mapletctl ";

bool is_ours(const fs::path& list) {
  std::string line;
  std::ifstream stream{list};
  return std::getline(stream, line) && line.starts_with(kOurs);
}

/// A place for a new recording. Only what an earlier run of ours wrote is removed.
TumWriter::Done make_room(const fs::path& folder) {
  std::error_code error;
  fs::create_directories(folder, error);
  if (error) return Problem{fmt::format("{}: {}", folder.string(), error.message())};
  const bool again = is_ours(folder / "depth.txt");
  for (const char* name : {"depth", "rgb", "labels", "depth.txt", "rgb.txt", "groundtruth.txt",
                           "camera.toml", "planes.jsonl"}) {
    if (again) {
      fs::remove_all(folder / name, error);
    } else if (fs::exists(folder / name, error)) {
      return Problem{fmt::format("{}: holds {} of another recording: choose another folder",
                                 folder.string(), name)};
    }
    if (error) return Problem{fmt::format("{}: {}", (folder / name).string(), error.message())};
  }
  return {};
}

}  // namespace

template <class Image>
TumWriter::Done TumWriter::write_image(const fs::path& file, const Image& image) {
  std::error_code error;
  fs::create_directories(file.parent_path(), error);
  if (error) return Problem{fmt::format("{}: {}", file.parent_path().string(), error.message())};
  if (auto done = write_png(file, image); !done) return Problem{done.error().what.c_str()};
  bytes_ += fs::file_size(file, error);
  return {};
}

tl::expected<TumWriter, std::string> TumWriter::create(const fs::path& folder,
                                                       const RecordedCamera& camera,
                                                       std::string_view title) {
  if (auto done = make_room(folder); !done) return Problem{done.error()};
  TumWriter writer{folder, title};
  if (auto done = writer.open(writer.depth_, "depth.txt", ""); !done) return Problem{done.error()};
  if (auto done = writer.write_camera(camera); !done) return Problem{done.error()};
  return writer;
}

TumWriter::Done TumWriter::open(List& list, std::string_view name, std::string_view columns) {
  list.file = folder_ / name;
  list.stream.open(list.file, std::ios::trunc);
  list.stream << kOurs << title_ << '\n' << columns;
  if (!list.stream) return Problem{fmt::format("{}: cannot be written", list.file.string())};
  return {};
}

TumWriter::Done TumWriter::write_camera(const RecordedCamera& recorded) {
  List list;
  if (auto done = open(list, "camera.toml", ""); !done) return done;
  const CameraModel& camera = recorded.camera;
  // TOML's floating-point numbers have a point: whole numbers are integers there.
  const auto number = [](double value) {
    const std::string text = fmt::format("{}", value);
    return text.find_first_of(".e") == std::string::npos ? text + ".0" : text;
  };
  list.stream << "[depth]\n"
              << "width_px = " << camera.width_px << '\n'
              << "height_px = " << camera.height_px << '\n'
              << "fx_px = " << number(camera.fx_px) << '\n'
              << "fy_px = " << number(camera.fy_px) << '\n'
              << "cx_px = " << number(camera.cx_px) << '\n'
              << "cy_px = " << number(camera.cy_px) << '\n'
              << "metres_per_unit = " << number(recorded.metres_per_unit) << '\n'
              << "invalid_values = [0";
  for (const std::uint16_t value : recorded.invalid_values) {
    if (value != 0) list.stream << ", " << value;
  }
  list.stream << "]\nregistered_to_colour = " << (recorded.registered_to_colour ? "true" : "false")
              << '\n';
  if (recorded.rate_hz > 0.0) list.stream << "rate_hz = " << number(recorded.rate_hz) << '\n';
  list.stream.flush();
  if (!list.stream) return Problem{fmt::format("{}: cannot be written", list.file.string())};
  return {};
}

TumWriter::Done TumWriter::write(const DepthFrame& frame) {
  image_ = fmt::format("{:06}.png", count_++);
  const std::string stamp = format_stamp(frame.stamp);
  if (auto done = write_image(folder_ / "depth" / image_, frame.depth); !done) return done;
  depth_.stream << stamp << " depth/" << image_ << '\n';
  if (frame.gray.empty()) return {};
  if (auto done = write_image(folder_ / "rgb" / image_, frame.gray); !done) return done;
  if (!gray_.stream.is_open()) {
    if (auto done = open(gray_, "rgb.txt", ""); !done) return done;
  }
  gray_.stream << stamp << " rgb/" << image_ << '\n';
  return {};
}

TumWriter::Done TumWriter::write_pose(Stamp stamp, const Se3& T_world_camera) {
  if (!poses_.stream.is_open()) {
    auto done =
        open(poses_, "groundtruth.txt", "# timestamp tx ty tz qx qy qz qw (camera in world)\n");
    if (!done) return done;
  }
  const auto& t = T_world_camera.t;
  const auto& q = T_world_camera.q;
  poses_.stream << fmt::format("{} {:.9f} {:.9f} {:.9f} {:.12f} {:.12f} {:.12f} {:.12f}\n",
                               format_stamp(stamp), t.x(), t.y(), t.z(), q.x(), q.y(), q.z(),
                               q.w());
  return {};
}

TumWriter::Done TumWriter::write_beside(std::string_view name,
                                        const ImageView<std::uint16_t>& image) {
  return write_image(folder_ / name / image_, image);
}

TumWriter::Done TumWriter::finish() {
  for (List* list : {&depth_, &gray_, &poses_}) {
    if (!list->stream.is_open()) continue;
    list->stream.close();
    if (!list->stream) return Problem{fmt::format("{}: cannot be written", list->file.string())};
  }
  return {};
}

}  // namespace maplet
