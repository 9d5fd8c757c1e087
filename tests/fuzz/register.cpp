// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include <cstring>
#include <memory>
#include <vector>

#include "core/base/crc.hpp"
#include "core/maplet/codec.hpp"
#include "core/registration/place_index.hpp"
#include "core/registration/place_verifier.hpp"
#include "core/registration/verdict.hpp"
#include "tests/fuzz/fuzz.hpp"

namespace {

using namespace maplet;

// Size and checksums are mended, or no input would get past them.
bool mended(std::vector<std::byte> bytes, Maplet& out) {
  if (bytes.size() < codec::kHeaderBytes + 4 || bytes.size() > kMaxMapletBytes) return false;
  const auto put = [&](std::size_t at, std::uint32_t value) {
    for (std::size_t i = 0; i < 4; ++i) bytes[at + i] = static_cast<std::byte>(value >> (8 * i));
  };
  put(28, static_cast<std::uint32_t>(bytes.size()));
  for (const std::size_t end : layer_ends(bytes)) {
    put(end - 4, crc32c(std::span{bytes}.first(end - 4)));
  }
  return decode(bytes, out).has_value();
}

void check(const MapletAlignment& a) {
  fuzz::require(a.T_a_b.se3.t.allFinite() && a.T_a_b.se3.q.coeffs().allFinite() &&
                    a.covariance.allFinite() && a.information.allFinite(),
                "an alignment is finite");
  fuzz::require(a.covariance.diagonal().minCoeff() >= 0.0, "its variances are none below 0");
  fuzz::require(a.overlap >= 0.0 && a.overlap <= 1.0, "its overlap is a share");
}

}  // namespace

// Two maplets of anybody, registered every way that there is: the first two bytes say where the
// first one ends, the rest are a guess's steps and the two.
int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  constexpr std::size_t kHead = 8;
  if (size < kHead) return 0;
  std::vector<std::byte> all(size - kHead);
  if (!all.empty()) std::memcpy(all.data(), data + kHead, all.size());
  const std::size_t split = std::min<std::size_t>(data[0] + 256U * data[1], all.size());
  static const auto a = std::make_unique<Maplet>();
  static const auto b = std::make_unique<Maplet>();
  if (!mended({all.begin(), all.begin() + static_cast<std::ptrdiff_t>(split)}, *a)) return 0;
  if (!mended({all.begin() + static_cast<std::ptrdiff_t>(split), all.end()}, *b)) return 0;
  b->key.agent = static_cast<std::uint16_t>(a->key.agent + 1);

  Vector6d xi;
  for (int i = 0; i < 6; ++i) xi[i] = (data[2 + i] - 128.0) / (i < 3 ? 64.0 : 256.0);
  const Transform<MapletA, MapletB> guess{Se3::exp(xi)};
  static const auto verifier = std::make_unique<Verifier>(RegistrationConfig{});
  const Frontier frontier = find_frontier(*a, up_of(*a));
  for (const RegionOfInterest* region :
       {static_cast<const RegionOfInterest*>(nullptr), &frontier.region}) {
    verifier->look_first_at(region);
    const Closure closure =
        verifier->verify(*a, *b, guess, 0.6, 0.35, Prior::kPath, Deadline::never());
    if (closure.aligned) check(closure.alignment);
  }
  verifier->look_first_at(nullptr);

  static const auto planar = [] {
    auto icap = std::make_unique<Icap>(RegistrationConfig{});
    icap->hold_to(PlanarMotion{Eigen::Vector3d{0.0, -1.0, 0.0}});
    return icap;
  }();
  if (const auto held = planar->align(*a, *b, guess, Deadline::never())) check(*held);

  static Arena arena;
  static PlaceIndex index{4, arena};
  static PlaceVerifier places{RegistrationConfig{}, 8, arena};
  index.add(*a);
  places.clear();
  for (const PlaceCandidate& candidate : index.query(*b, {}, Deadline::never())) {
    if (candidate.key != a->key) continue;
    (void)places.add(*a, *b, candidate.guesses, Deadline::never());
  }
  for (const PlaceHypothesis& h : places.hypotheses()) check(h.alignment);
  return 0;
}
