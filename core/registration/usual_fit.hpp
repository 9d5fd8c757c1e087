// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>

namespace maplet {

/// How well the planes of consecutive maplets fit: what sensor and surfaces are good for there. A
/// place that is seen again fits about as well; one that only looks alike fits worse, and how much
/// worse is too bad no constant says (planes fit three times better in a simulated room than in a
/// kitchen).
///
/// Memory  a value. Threads  one.
/// Math    docs/math/icap.md, eq. 23
class UsualFit {
 public:
  /// @param chi2_per_dof  of two consecutive maplets' alignment
  void note(double chi2_per_dof) noexcept;

  /// Up to which chi2 per degree of freedom a place may be the same one; infinite as long as
  /// nothing is known.
  [[nodiscard]] double limit() const noexcept;

 private:
  static constexpr int kBins = 64;  ///< four an octave, from 2^-10 on
  std::array<std::uint32_t, kBins> bins_{};
  std::uint32_t count_ = 0;
};

}  // namespace maplet
