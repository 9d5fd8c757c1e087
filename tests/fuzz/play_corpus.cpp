// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// In place of libFuzzer's main: feeds every file of the folders on the command line, in order,
// whole and cut off at every length (long files: at 64 lengths).
#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <iterator>
#include <vector>

#include "tests/fuzz/fuzz.hpp"

namespace {

namespace fs = std::filesystem;

std::vector<std::uint8_t> read(const fs::path& file) {
  std::ifstream in{file, std::ios::binary};
  return {std::istreambuf_iterator<char>{in}, {}};
}

void feed(const std::vector<std::uint8_t>& input, std::size_t size) {
  // A copy of exactly this size: a sanitizer sees a read beyond it.
  const std::vector<std::uint8_t> part(input.begin(),
                                       input.begin() + static_cast<std::ptrdiff_t>(size));
  (void)LLVMFuzzerTestOneInput(part.data(), part.size());
}

}  // namespace

int main(int argc, char** argv) {
  std::size_t files = 0;
  for (int i = 1; i < argc; ++i) {
    std::vector<fs::path> inputs;
    for (const auto& entry : fs::recursive_directory_iterator{argv[i]}) {
      if (entry.is_regular_file()) inputs.push_back(entry.path());
    }
    std::sort(inputs.begin(), inputs.end());
    for (const fs::path& file : inputs) {
      const auto input = read(file);
      const std::size_t step = std::max<std::size_t>(1, input.size() / 64);
      for (std::size_t size = 0; size < input.size(); size += step) feed(input, size);
      feed(input, input.size());
      ++files;
    }
  }
  std::printf("%zu files played\n", files);
  return files > 0 ? 0 : 1;  // a corpus that is not there proves nothing
}
