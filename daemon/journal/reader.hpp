// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <functional>
#include <span>

#include "daemon/journal/block_file.hpp"
#include "daemon/journal/items.hpp"

namespace maplet::journal {

/// What is not as it was written.
struct Damage {
  std::uint32_t turns = 0;          ///< gone, of those before the last one that is there
  std::uint32_t mended_bits = 0;    ///< set right: nothing is lost by them
  std::uint64_t tail_bytes = 0;     ///< a last write that did not come to its end
  std::uint64_t missing_bytes = 0;  ///< the file is shorter than it was
  std::uint32_t malformed = 0;      ///< turns whose checksums are right, but that make no sense

  [[nodiscard]] bool any() const noexcept {
    return turns + mended_bits + tail_bytes + missing_bytes + malformed > 0;
  }
};

/// What a file holds, and where one goes on writing.
struct Survey {
  enum class State : std::uint8_t { kEmpty, kGood, kNewer };
  State state = State::kEmpty;
  std::uint16_t version = kVersion;  ///< the oldest of its turns'
  Life life;
  std::uint32_t half_pages = 0;
  int half = 0;                       ///< the one that counts
  std::uint32_t generation = 0;       ///< of it
  std::uint32_t most_generation = 0;  ///< ever seen, an interrupted change of halves included
  std::uint32_t next_number = 0;
  std::uint64_t end = 0;  ///< behind the last turn, from the file's beginning
  std::array<std::uint32_t, kStreams> ends{};
  Damage damage;
};

/// Reads a store, or anything at all.
///
/// Memory   a view of the caller's buffer, kMaxTurnBytes.
/// Time     O(bytes of the half that counts).
class Reader {
 public:
  Reader(BlockFile& file, std::span<std::byte> buffer) noexcept : file_{file}, buffer_{buffer} {}

  [[nodiscard]] Survey survey() noexcept;
  /// Hands over what the half that counts holds, in the order it was written.
  void read(const Survey& survey, Visitor& visitor) noexcept;

 private:
  using OnTurn = std::function<bool(const TurnHead&, std::span<const std::byte>)>;
  struct Walk {
    bool newer = false;
    bool known = false;  ///< a head was there: the three below
    bool older_lap = false;
    bool counts = false;  ///< a turn of its own, not only carried ones
    Life life;
    std::uint32_t generation = 0;
    std::uint32_t half_pages = 0;
    std::uint16_t version = kVersion;
    std::uint32_t most_generation = 0;
    std::uint32_t next_number = 0;
    std::uint64_t end = 0;
    std::array<std::uint32_t, kStreams> ends{};
    Damage damage;
  };

  [[nodiscard]] Walk walk(std::uint64_t from, std::uint64_t to, const OnTurn& on_turn) noexcept;
  [[nodiscard]] std::optional<TurnHead> head_at(std::uint64_t at, Damage& damage) noexcept;
  [[nodiscard]] bool payload_at(std::uint64_t at, const TurnHead& head, Damage& damage) noexcept;
  static void take_head(Walk& walk, const TurnHead& head) noexcept;
  [[nodiscard]] std::uint32_t find_half_pages() noexcept;
  /// Something stands there that is no turn. Only where no earlier lap left any.
  [[nodiscard]] bool page_used(std::uint64_t at) noexcept;

  BlockFile& file_;
  std::span<std::byte> buffer_;
};

}  // namespace maplet::journal
