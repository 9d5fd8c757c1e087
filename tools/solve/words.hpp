// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <algorithm>
#include <charconv>
#include <cmath>
#include <string_view>

#include "tools/solve/graph_file.hpp"

namespace maplet::graphs {

/// Takes the first line off a text. @return it, without its end
inline std::string_view take_line(std::string_view& text) {
  const auto end = std::min(text.find('\n'), text.size());
  const std::string_view line = text.substr(0, end);
  text.remove_prefix(std::min(end + 1, text.size()));
  return line;
}

/// The words of one line.
class Words {
 public:
  explicit Words(std::string_view line) : rest_{line} {}

  [[nodiscard]] std::string_view next() {
    const auto from = rest_.find_first_not_of(" \t\r");
    if (from == std::string_view::npos) return rest_ = {};
    rest_.remove_prefix(from);
    const auto to = std::min(rest_.find_first_of(" \t\r"), rest_.size());
    const auto word = rest_.substr(0, to);
    rest_.remove_prefix(to);
    return word;
  }
  template <class T>
  [[nodiscard]] bool read(T& value) {
    std::string_view word = next();
    if (!word.empty() && word.front() == '+') word.remove_prefix(1);
    const auto [end, error] = std::from_chars(word.data(), word.data() + word.size(), value);
    return error == std::errc{} && end == word.data() + word.size() && !word.empty();
  }
  /// Reads `count` finite numbers. @return what is wrong, or nullptr
  [[nodiscard]] const char* numbers(double* to, int count) {
    for (int i = 0; i < count; ++i) {
      if (!read(to[i])) return "a number is missing or malformed";
      if (!std::isfinite(to[i])) return "a number is not finite";
    }
    return nullptr;
  }
  /// A symmetric matrix of n x n, its upper triangle row by row. @return as numbers
  template <class Matrix>
  [[nodiscard]] const char* symmetric(Matrix& to, int n) {
    for (int r = 0; r < n; ++r)
      for (int c = r; c < n; ++c) {
        double v = 0.0;
        if (const char* wrong = numbers(&v, 1)) return wrong;
        to(r, c) = to(c, r) = v;
      }
    return nullptr;
  }

 private:
  std::string_view rest_;
};

/// A pose as text has it: x y theta, or x y z qx qy qz qw. @return what is wrong, or nullptr
const char* read_pose(Words& words, bool planar, Se3& pose);

/// Remembers a line that was not taken. @param part  of a folder: the file in it
void complain(GraphFile& graph, int file, int line, const char* what, const std::string& part = {});

/// Reads a text line by line. @param read_line  of (line, graph, edge): what is wrong, or nullptr
template <class ReadLine>
void read_lines(std::string_view text, int file, GraphFile& graph, ReadLine&& read_line) {
  for (int line = 1; !text.empty(); ++line) {
    Edge edge;
    edge.file = file;
    edge.line = line;
    if (const char* wrong = read_line(take_line(text), graph, edge))
      complain(graph, file, line, wrong);
  }
}

/// Planar numbers stand at these places of a spatial tangent: x, y, theta of x y z rx ry rz.
inline constexpr std::array<int, 3> kPlanar{0, 1, 5};

}  // namespace maplet::graphs
