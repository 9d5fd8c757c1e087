// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "drivers/gpio/gpio_line.hpp"

#include <fmt/format.h>
#include <gpiod.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <filesystem>
#include <string_view>
#include <utility>

namespace maplet {

namespace {

using Problem = tl::unexpected<std::string>;
using Chip = std::unique_ptr<gpiod_chip, void (*)(gpiod_chip*)>;

constexpr const char* kConsumer = "mapletd";

std::vector<std::string> chip_names() {
  std::vector<std::string> names;
  std::error_code error;
  for (const auto& entry : std::filesystem::directory_iterator{"/dev", error}) {
    std::string name = entry.path().filename().string();
    if (name.starts_with("gpiochip")) names.push_back(std::move(name));
  }
  std::sort(names.begin(), names.end());
  return names;
}

/// Of a chip's lines by name or number.
gpiod_line* line_of(gpiod_chip* chip, const std::string& name) {
  unsigned number = 0;
  const char* end = name.data() + name.size();
  if (const auto [at, error] = std::from_chars(name.data(), end, number);
      error == std::errc{} && at == end) {
    return number < gpiod_chip_num_lines(chip) ? gpiod_chip_get_line(chip, number) : nullptr;
  }
  return gpiod_chip_find_line(chip, name.c_str());
}

bool is_chip(gpiod_chip* chip, const std::string& wanted) {
  return wanted.empty() || wanted == gpiod_chip_name(chip) || wanted == gpiod_chip_label(chip);
}

struct Found {
  Chip chip{nullptr, gpiod_chip_close};
  gpiod_line* line = nullptr;
};

tl::expected<Found, std::string> find(const std::string& where) {
  const auto colon = where.find(':');
  const std::string wanted = colon == std::string::npos ? "" : where.substr(0, colon);
  const std::string name = colon == std::string::npos ? where : where.substr(colon + 1);
  std::string seen;
  for (const std::string& chip_name : chip_names()) {
    Chip chip{gpiod_chip_open_by_name(chip_name.c_str()), gpiod_chip_close};
    if (!seen.empty()) seen += ", ";
    if (!chip) {
      seen += fmt::format("{} ({})", chip_name, std::strerror(errno));
      continue;
    }
    seen += fmt::format("{} '{}' of {} lines", chip_name, gpiod_chip_label(chip.get()),
                        gpiod_chip_num_lines(chip.get()));
    if (!is_chip(chip.get(), wanted)) continue;
    if (gpiod_line* line = line_of(chip.get(), name)) return Found{std::move(chip), line};
  }
  if (seen.empty()) {
    return Problem{fmt::format(
        "GPIO line '{}': this machine has no GPIO chip; load its driver, or leave the key empty",
        where)};
  }
  return Problem{fmt::format("GPIO line '{}': not found; there are {} (gpioinfo lists the lines)",
                             where, seen)};
}

std::string refusal(const std::string& where, gpiod_line* line, int error) {
  const char* user = gpiod_line_consumer(line);
  if (error == EBUSY) {
    return fmt::format("GPIO line '{}': in use by '{}'; end that, or name another line", where,
                       user != nullptr && *user != '\0' ? user : "the kernel");
  }
  if (error == EACCES || error == EPERM) {
    return fmt::format("GPIO line '{}': not permitted; add the user to the chip's group (gpio)",
                       where);
  }
  return fmt::format("GPIO line '{}': the chip refuses: {}", where, std::strerror(error));
}

}  // namespace

void GpioLine::Release::operator()(gpiod_line* line) const noexcept { gpiod_line_release(line); }
void GpioLine::Close::operator()(gpiod_chip* chip) const noexcept { gpiod_chip_close(chip); }

tl::expected<GpioLine, std::string> GpioLine::open(const std::string& where, bool active_low,
                                                   Use use) {
  auto found = find(where);
  if (!found) return Problem{found.error()};
  const int flags = active_low ? GPIOD_LINE_REQUEST_FLAG_ACTIVE_LOW : 0;
  const int failed =
      use == Use::kOutput
          ? gpiod_line_request_output_flags(found->line, kConsumer, flags, 0)
          : gpiod_line_request_both_edges_events_flags(found->line, kConsumer, flags);
  if (failed != 0) return Problem{refusal(where, found->line, errno)};
  GpioLine line;
  line.chip_.reset(found->chip.release());
  line.line_.reset(found->line);
  return line;
}

bool GpioLine::set(bool on) noexcept { return gpiod_line_set_value(line_.get(), on ? 1 : 0) == 0; }

std::optional<bool> GpioLine::value() const noexcept {
  const int value = gpiod_line_get_value(line_.get());
  if (value < 0) return {};
  return value != 0;
}

int GpioLine::event_fd() const noexcept { return gpiod_line_event_get_fd(line_.get()); }

std::optional<GpioLine::Edge> GpioLine::read_edge() noexcept {
  gpiod_line_event event{};
  if (gpiod_line_event_read(line_.get(), &event) != 0) return {};
  return Edge{event.event_type == GPIOD_LINE_EVENT_RISING_EDGE,
              Instant{std::chrono::seconds{event.ts.tv_sec} + Duration{event.ts.tv_nsec}}};
}

std::vector<GpioChip> gpio_chips() {
  std::vector<GpioChip> chips;
  for (const std::string& name : chip_names()) {
    GpioChip& chip = chips.emplace_back();
    chip.name = name;
    const Chip opened{gpiod_chip_open_by_name(name.c_str()), gpiod_chip_close};
    if (!opened) {
      chip.problem = std::strerror(errno);
      continue;
    }
    chip.label = gpiod_chip_label(opened.get());
    chip.lines = gpiod_chip_num_lines(opened.get());
  }
  return chips;
}

}  // namespace maplet
