// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/memory_status.hpp"

#include <sys/resource.h>
#include <unistd.h>

#include <algorithm>
#include <cstdio>
#include <filesystem>
#include <fstream>
#include <string>

namespace maplet::daemon {

namespace {

namespace fs = std::filesystem;

std::optional<std::uint64_t> number_in(const fs::path& file) {
  std::ifstream in{file};
  std::uint64_t value = 0;
  if (in >> value) return value;  // "max" is no number
  return {};
}

}  // namespace

std::size_t rss_bytes() noexcept {
  std::FILE* file = std::fopen("/proc/self/statm", "re");
  if (file == nullptr) return 0;
  unsigned long size = 0;
  unsigned long resident = 0;
  const bool good = std::fscanf(file, "%lu %lu", &size, &resident) == 2;
  std::fclose(file);
  return good ? resident * static_cast<std::size_t>(sysconf(_SC_PAGESIZE)) : 0;
}

std::size_t peak_rss_bytes() noexcept {
  rusage usage{};
  getrusage(RUSAGE_SELF, &usage);
  return static_cast<std::size_t>(usage.ru_maxrss) * 1024;
}

std::optional<std::uint64_t> cgroup_memory_limit() {
  // "0::/system.slice/mapletd.service" (version 2), "9:memory:/..." (version 1).
  std::ifstream groups{"/proc/self/cgroup"};
  std::optional<std::uint64_t> least;
  for (std::string line; std::getline(groups, line);) {
    const bool unified = line.starts_with("0::");
    const auto memory = line.find(":memory:");
    if (!unified && memory == std::string::npos) continue;
    const std::string root = unified ? "/sys/fs/cgroup" : "/sys/fs/cgroup/memory";
    fs::path group = line.substr(unified ? 3 : memory + 8);
    while (true) {  // every group above limits, too
      const fs::path folder = root + group.string();
      const auto limit = number_in(folder / (unified ? "memory.max" : "memory.limit_in_bytes"));
      if (limit && *limit < std::uint64_t{1} << 62)
        least = std::min(least.value_or(*limit), *limit);
      if (!group.has_relative_path()) break;
      group = group.parent_path();
    }
  }
  return least;
}

}  // namespace maplet::daemon
