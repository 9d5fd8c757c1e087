// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include <cstring>
#include <memory>
#include <vector>

#include "core/base/crc.hpp"
#include "core/maplet/codec.hpp"
#include "core/registration/verdict.hpp"
#include "tests/fuzz/fuzz.hpp"

// A maplet from anybody: decoded, written again, registered against itself. Size and checksums are
// mended first, or no input would get past them.
int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace maplet;
  if (size < codec::kHeaderBytes + 4 || size > kMaxMapletBytes) return 0;
  std::vector<std::byte> bytes(size);
  std::memcpy(bytes.data(), data, size);
  static const auto maplet = std::make_unique<Maplet>();
  (void)decode(bytes, *maplet);  // as it came
  const auto put = [&](std::size_t at, std::uint32_t value) {
    for (std::size_t i = 0; i < 4; ++i) bytes[at + i] = static_cast<std::byte>(value >> (8 * i));
  };
  put(28, static_cast<std::uint32_t>(size));
  const auto ends = layer_ends(bytes);
  for (const std::size_t end : ends) put(end - 4, crc32c(std::span{bytes}.first(end - 4)));
  if (!decode(bytes, *maplet)) return 0;

  fuzz::require(!maplet->keyframes.empty(), "a maplet has an origin");
  for (const MapletPlane& p : maplet->planes) {
    fuzz::require(p.centre.allFinite() && p.covariance.allFinite(), "its planes are finite");
    fuzz::require(p.grid.first_bit + std::size_t{p.grid.columns} * p.grid.rows <= kMaxMapletCells,
                  "its cells are inside");
  }
  // Each run of whole layers is a maplet, too.
  static const auto coarse = std::make_unique<Maplet>();
  for (const std::size_t end : ends) {
    fuzz::require(decode(std::span{bytes}.first(end), *coarse) || end != size, "all layers decode");
  }
  static const auto verifier = std::make_unique<Verifier>(RegistrationConfig{});
  const Closure closure =
      verifier->verify(*maplet, *maplet, {}, 0.3, 0.2, Prior::kGuess, Deadline::never());
  if (closure.aligned) {
    const MapletAlignment& a = closure.alignment;
    fuzz::require(a.T_a_b.se3.t.allFinite() && a.covariance.allFinite(), "its alignment is finite");
  }
  return 0;
}
