// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstddef>
#include <cstdint>
#include <optional>
#include <span>

#include "core/base/expected.hpp"
#include "core/base/static_vector.hpp"
#include "transport/exchange/ledger.hpp"

namespace maplet {

/// What two ledgers differ in, as far as one digest tells. What does not fit is left out: the next
/// digest tells it again.
struct Difference {
  static constexpr std::size_t kMax = 256;
  using Ranges = StaticVector<KeyRange, kMax>;

  Ranges i_lack;         ///< the peer holds it: to request
  Ranges they_lack;      ///< we hold it: to send or to offer
  bool complete = true;  ///< nothing was left out
};

/// Writes a digest of as many lives as fit, in order of life, from after `after` on (nothing: from
/// the beginning). The digest says which span of lives it covers, so that a life that it does not
/// name there is one that the writer knows nothing of.
///
/// @param written  bytes of `out` used
/// @return the last life covered, to go on after; nothing when the digest reaches the end
[[nodiscard]] std::optional<Life> write_digest(const Ledger& ledger,
                                               const std::optional<Life>& after,
                                               std::span<std::byte> out,
                                               std::size_t& written) noexcept;

/// Reads a peer's digest: notes in our ledger what exists and says what each side lacks.
/// @return kBadInput when the bytes are no digest; what was understood before is used all the same
[[nodiscard]] Expected<Difference> read_digest(std::span<const std::byte> bytes,
                                               Ledger& ledger) noexcept;

/// Ranges of records, for a request. @return how many of them fit
[[nodiscard]] std::size_t write_ranges(std::span<const KeyRange> ranges, std::span<std::byte> out,
                                       std::size_t& written) noexcept;
[[nodiscard]] Expected<Difference::Ranges> read_ranges(std::span<const std::byte> bytes) noexcept;

}  // namespace maplet
