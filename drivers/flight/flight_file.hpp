// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <cstdio>
#include <memory>
#include <span>
#include <string>
#include <tl/expected.hpp>
#include <vector>

/// The flight recorder's file: blocks in a ring, each with a number and a checksum
/// (docs/journal.md). The first block says what ran and stays; of the rest the oldest goes.
namespace maplet::flight {

enum class Block : std::uint8_t {
  kHead = 0,    ///< JSON: configuration, agent, epoch, pace
  kEvents = 1,  ///< events.hpp
  kDepth = 2,   ///< of the frame whose event came last: depth_code.hpp
  kGray = 3,    ///< as it came
};

inline constexpr std::size_t kAlign = 64;
inline constexpr std::size_t kBlockHeadBytes = 24;
inline constexpr std::uint32_t kMostBlockBytes = 16U << 20;

struct CloseFile {
  void operator()(std::FILE* file) const noexcept { std::fclose(file); }
};
using File = std::unique_ptr<std::FILE, CloseFile>;

class RingReader;

/// Writes blocks, round and round.
///
/// Threads  one.
class RingWriter {
 public:
  /// An earlier recording of that name becomes NAME.1: what was before a crash stays. Any other
  /// file is left alone.
  /// @return why it cannot be made, on one line
  [[nodiscard]] static tl::expected<std::unique_ptr<RingWriter>, std::string> make(
      const std::string& path, std::uint64_t bytes);
  [[nodiscard]] bool put(Block type, std::span<const std::byte> bytes);
  [[nodiscard]] bool flush();
  /// Of this file, whatever has its name now. @return why not
  [[nodiscard]] tl::expected<std::unique_ptr<RingReader>, std::string> reader() const;

 private:
  std::string path_;
  File file_;
  std::uint64_t size_ = 0;
  std::uint64_t first_ = 0;  ///< behind the head
  std::uint64_t at_ = 0;
  std::uint32_t next_ = 0;
};

/// Reads blocks in their order: from the beginning, or from the oldest that is left.
class RingReader {
 public:
  [[nodiscard]] static tl::expected<std::unique_ptr<RingReader>, std::string> open(
      const std::string& path);
  /// @param name  for messages
  [[nodiscard]] static tl::expected<std::unique_ptr<RingReader>, std::string> read(
      File file, const std::string& name);
  [[nodiscard]] const std::string& head() const noexcept { return head_; }
  /// Nothing was overwritten: it holds the whole run.
  [[nodiscard]] bool complete() const noexcept { return complete_; }
  struct Entry {
    Block type{};
    std::uint32_t bytes = 0;
    std::uint32_t crc = 0;
    std::uint64_t at = 0;  ///< of the content
  };
  /// @return the next block; nullptr at the end
  [[nodiscard]] const Entry* next() noexcept {
    return next_ < entries_.size() ? &entries_[next_++] : nullptr;
  }
  /// @return false: damaged
  [[nodiscard]] bool read(const Entry& entry, std::vector<std::byte>& out);
  /// Writes the blocks that are there, in order, without what was overwritten: beside `path` first,
  /// so that what was there stays until all is written. Takes the place of recordings only.
  /// @return why not
  [[nodiscard]] std::string save(const std::string& path);

 private:
  File file_;
  std::vector<Entry> entries_;
  std::string head_;
  std::size_t next_ = 0;
  bool complete_ = true;
};

}  // namespace maplet::flight
