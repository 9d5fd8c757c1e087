// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "drivers/replay/text.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cerrno>
#include <charconv>
#include <cstring>
#include <fstream>
#include <limits>

namespace maplet {

namespace {

bool is_digit(char c) noexcept { return c >= '0' && c <= '9'; }
bool is_space(char c) noexcept { return c == ' ' || c == '\t' || c == '\r'; }

// Stamps stay so small that the difference of any two fits into 64 bits.
constexpr std::int64_t kMaxStampNs = std::numeric_limits<std::int64_t>::max() / 2;

/// A decimal number taken apart: digits * 10^exponent.
struct Decimal {
  std::string_view whole, fraction;
  bool negative = false;
  int exponent = 0;

  [[nodiscard]] int digit(std::size_t i) const noexcept {
    return (i < whole.size() ? whole[i] : fraction[i - whole.size()]) - '0';
  }
  [[nodiscard]] std::size_t digits() const noexcept { return whole.size() + fraction.size(); }
};

std::string_view take_digits(std::string_view& text) noexcept {
  const auto end = std::find_if_not(text.begin(), text.end(), is_digit);
  const std::string_view digits = text.substr(0, static_cast<std::size_t>(end - text.begin()));
  text.remove_prefix(digits.size());
  return digits;
}

std::optional<Decimal> take_apart(std::string_view text) noexcept {
  Decimal out;
  if (!text.empty() && (text[0] == '-' || text[0] == '+')) {
    out.negative = text[0] == '-';
    text.remove_prefix(1);
  }
  out.whole = take_digits(text);
  if (!text.empty() && text[0] == '.') {
    text.remove_prefix(1);
    out.fraction = take_digits(text);
  }
  if (out.digits() == 0) return {};
  if (!text.empty() && (text[0] == 'e' || text[0] == 'E')) {
    text.remove_prefix(1);
    if (text.starts_with('+')) text.remove_prefix(1);
    const auto [end, error] = std::from_chars(text.data(), text.data() + text.size(), out.exponent);
    if (error != std::errc{} || out.exponent < -99 || out.exponent > 99) return {};
    text.remove_prefix(static_cast<std::size_t>(end - text.data()));
  }
  if (!text.empty()) return {};
  return out;
}

std::string_view take_word(std::string_view& line) noexcept {
  const auto begin = std::find_if_not(line.begin(), line.end(), is_space);
  const auto end = std::find_if(begin, line.end(), is_space);
  const std::string_view word = line.substr(static_cast<std::size_t>(begin - line.begin()),
                                            static_cast<std::size_t>(end - begin));
  line.remove_prefix(static_cast<std::size_t>(end - line.begin()));
  return word;
}

}  // namespace

std::optional<Stamp> parse_stamp(std::string_view text) noexcept {
  const auto number = take_apart(text);
  if (!number) return {};
  // Nanoseconds are the digits up to `wanted`; missing ones are zeros.
  const std::int64_t wanted =
      static_cast<std::int64_t>(number->whole.size()) + number->exponent + 9;
  const auto digits = static_cast<std::int64_t>(number->digits());
  std::int64_t ns = 0;
  for (std::int64_t i = 0; i < wanted; ++i) {
    const int digit = i < digits ? number->digit(static_cast<std::size_t>(i)) : 0;
    if (ns > (kMaxStampNs - digit) / 10) return {};
    ns = ns * 10 + digit;
    if (ns == 0 && i >= digits) break;  // nothing but zeros
  }
  const bool up =
      wanted >= 0 && wanted < digits && number->digit(static_cast<std::size_t>(wanted)) >= 5;
  ns += up ? 1 : 0;
  return Stamp{number->negative ? -ns : ns};
}

std::string format_stamp(Stamp stamp) {
  const std::int64_t ns = stamp.count();
  // Unsigned: the most negative number has no positive twin.
  const std::uint64_t size =
      ns < 0 ? std::uint64_t{0} - static_cast<std::uint64_t>(ns) : static_cast<std::uint64_t>(ns);
  const std::uint64_t whole = size / 1'000'000'000;
  const std::uint64_t rest = size % 1'000'000'000;
  const char* sign = ns < 0 ? "-" : "";
  return rest % 1000 == 0 ? fmt::format("{}{}.{:06}", sign, whole, rest / 1000)
                          : fmt::format("{}{}.{:09}", sign, whole, rest);
}

std::vector<ListedImage> parse_image_list(std::string_view text) {
  std::vector<ListedImage> images;
  for (int number = 1; !text.empty(); ++number) {
    std::string_view line = text.substr(0, text.find('\n'));
    text.remove_prefix(std::min(text.size(), line.size() + 1));
    line = line.substr(0, line.find('#'));
    const std::string_view stamp = take_word(line);
    if (stamp.empty()) continue;
    const std::string_view file = take_word(line);
    ListedImage image{number, parse_stamp(stamp), std::string{file}};
    const auto control = [](char c) { return static_cast<unsigned char>(c) < 0x20; };
    if (file.empty() || std::any_of(file.begin(), file.end(), control)) image.stamp.reset();
    if (!image.stamp) image.file.clear();
    images.push_back(std::move(image));
  }
  return images;
}

tl::expected<std::string, std::string> read_text(const std::filesystem::path& file,
                                                 std::size_t max_bytes) {
  const auto problem = [&](std::string_view why) {
    return tl::unexpected<std::string>{fmt::format("{}: {}", file.string(), why)};
  };
  std::error_code error;
  const auto status = std::filesystem::status(file, error);
  if (error) return problem(error.message());
  if (!std::filesystem::is_regular_file(status)) return problem("not a file");
  errno = 0;
  std::ifstream in{file, std::ios::binary};
  if (!in) return problem(errno != 0 ? std::strerror(errno) : "cannot be opened");
  std::string text;
  const auto size = std::filesystem::file_size(file, error);
  if (error) return problem(error.message());
  if (size > max_bytes) return problem(fmt::format("larger than {} bytes", max_bytes));
  text.resize(static_cast<std::size_t>(size));
  in.read(text.data(), static_cast<std::streamsize>(size));
  if (in.bad()) return problem("cannot be read");
  text.resize(static_cast<std::size_t>(in.gcount()));
  return text;
}

}  // namespace maplet
