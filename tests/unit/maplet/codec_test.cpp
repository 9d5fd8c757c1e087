// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "core/maplet/codec.hpp"

#include <gtest/gtest.h>

#include <algorithm>
#include <memory>
#include <random>
#include <vector>

#include "core/base/crc.hpp"
#include "core/maplet/quantise.hpp"
#include "tests/support/maplets.hpp"

namespace maplet {
namespace {

std::unique_ptr<Maplet> room_maplet() {
  auto m = std::make_unique<Maplet>();
  test::fill(*m, test::room(), test::camera_at({2.0, 2.5, 1.2}, 0.4));
  m->key = {3, 0xDEADBEEF, 41};
  m->stamp = Stamp{1'700'000'000'123'456'789};
  m->keyframes[0].stamp = m->stamp;
  std::mt19937 rng{1};
  for (std::int64_t i = 1; i < 12; ++i) {
    m->keyframes.push_back(
        {m->stamp + Stamp{i * 333'333'333},
         Transform<MapletFrame, CameraFrame>{Se3::exp(test::normal_tangent(rng, 2.0, 1.0))}});
  }
  return m;
}

std::vector<std::byte> bytes_of(const Maplet& m) {
  std::vector<std::byte> bytes(kMaxMapletBytes);
  bytes.resize(encode(m, bytes).value());
  return bytes;
}

void fix_checksums(std::vector<std::byte>& bytes) {
  for (const std::size_t end : layer_ends(bytes)) {
    const std::uint32_t crc = crc32c(std::span{bytes}.first(end - 4));
    for (std::size_t i = 0; i < 4; ++i) {
      bytes[end - 4 + i] = static_cast<std::byte>(crc >> (8 * i));
    }
  }
}

// A building's worth of walls with holes: too much for the first layers.
std::unique_ptr<Maplet> large_maplet() {
  auto m = room_maplet();
  std::mt19937 rng{5};
  std::uniform_real_distribution<double> at{-4.0, 4.0};
  std::uniform_real_distribution<double> half{0.1, 0.5};
  for (int i = 0; i < 111; ++i) {
    const Eigen::Quaterniond q = Se3::exp(test::normal_tangent(rng, 0.0, 1.5)).q;
    test::add_wall(*m,
                   {{at(rng), at(rng), at(rng)},
                    q * Eigen::Vector3d{half(rng), 0, 0},
                    q * Eigen::Vector3d{0, half(rng), 0}},
                   {});
  }
  std::bernoulli_distribution hole{0.05};
  for (MapletPlane& p : m->planes) {
    for (int cell = 0; cell < p.grid.columns * p.grid.rows; ++cell) {
      if (hole(rng)) m->clear_cell(p.grid, cell % p.grid.columns, cell / p.grid.columns);
    }
    m->measure_extent(p);
  }
  return m;
}

TEST(Codec, RoundTripStaysWithinItsBounds) {
  const auto in = room_maplet();
  const auto bytes = bytes_of(*in);
  const auto out = std::make_unique<Maplet>();
  ASSERT_TRUE(decode(bytes, *out));
  EXPECT_EQ(out->key, in->key);
  EXPECT_EQ(out->stamp, in->stamp);
  EXPECT_DOUBLE_EQ(out->cell_m, in->cell_m);
  ASSERT_EQ(out->keyframes.size(), in->keyframes.size());
  for (std::size_t i = 0; i < in->keyframes.size(); ++i) {
    EXPECT_EQ(out->keyframes[i].stamp, in->keyframes[i].stamp);
    const Se3& a = in->keyframes[i].T_maplet_camera.se3;
    const Se3& b = out->keyframes[i].T_maplet_camera.se3;
    EXPECT_LT((a.t - b.t).norm(), codec::kMaxTranslationError_m);
    EXPECT_LT((a.inverse() * b).angle(), codec::kMaxRotationError_rad);
  }
  ASSERT_EQ(out->planes.size(), in->planes.size());
  for (std::size_t i = 0; i < in->planes.size(); ++i) {
    const MapletPlane& a = in->planes[i];
    const MapletPlane& b = out->planes[i];
    EXPECT_LT(a.plane.n.cross(b.plane.n).norm(), codec::kMaxNormalError_rad);
    EXPECT_LT(std::abs(b.plane.distance(a.centre)), codec::kMaxOffsetError_m);
    EXPECT_EQ(a.grid.occupied, b.grid.occupied);
    EXPECT_LT((a.centre - b.centre).norm(), 2e-3);
    EXPECT_EQ(a.observations, b.observations);
    EXPECT_NEAR(a.mean_gray, b.mean_gray, 0.5);
    for (int k = 0; k < 3; ++k) {
      const double grown = std::sqrt(b.covariance(k, k) / a.covariance(k, k));
      EXPECT_GE(grown, 1.0);
      EXPECT_LE(grown, codec::kMaxSigmaFactor);
    }
  }
}

TEST(Codec, DecodedMapletEncodesToItsOwnBytes) {
  const auto bytes = bytes_of(*room_maplet());
  const auto m = std::make_unique<Maplet>();
  ASSERT_TRUE(decode(bytes, *m));
  const auto again = std::make_unique<Maplet>();
  ASSERT_TRUE(decode(bytes_of(*m), *again));
  for (std::size_t i = 0; i < m->planes.size(); ++i) {
    EXPECT_LT((m->planes[i].plane.n - again->planes[i].plane.n).norm(), 1e-12);
    EXPECT_EQ(m->planes[i].grid.occupied, again->planes[i].grid.occupied);
  }
}

TEST(Codec, EveryCellSurvives) {
  const auto in = std::make_unique<Maplet>();
  in->keyframes.push_back({});
  std::mt19937 rng{7};
  std::bernoulli_distribution coin{0.5};
  test::add_wall(*in, {{0, 0, 3}, {2.0, 0, 0}, {0, -1.5, 0}}, {});
  for (int r = 0; r < in->planes[0].grid.rows; ++r) {
    for (int c = 0; c < in->planes[0].grid.columns; ++c) {
      if (coin(rng)) in->set_cell(in->planes[0].grid, c, r);
    }
  }
  const auto out = std::make_unique<Maplet>();
  ASSERT_TRUE(decode(bytes_of(*in), *out));
  EXPECT_EQ(in->cells, out->cells);
}

TEST(Codec, AnyRunOfWholeLayersIsACoarserMaplet) {
  const auto in = large_maplet();
  const auto bytes = bytes_of(*in);
  const auto ends = layer_ends(bytes);
  ASSERT_EQ(ends.size(), 3U);
  EXPECT_LE(ends[0], codec::kCoarseBytes);
  EXPECT_GT(ends[0], codec::kCoarseBytes / 2);
  EXPECT_LE(ends[1], codec::kMiddleBytes);
  EXPECT_EQ(ends[2], bytes.size());
  const auto whole = std::make_unique<Maplet>();
  ASSERT_TRUE(decode(bytes, *whole));
  EXPECT_TRUE(whole->complete);
  EXPECT_EQ(whole->cells, in->cells);

  const auto part = std::make_unique<Maplet>();
  for (std::size_t layer = 0; layer + 1 < ends.size(); ++layer) {
    const auto decoded = decode(std::span{bytes}.first(ends[layer]), *part);
    ASSERT_TRUE(decoded) << decoded.error().what;
    EXPECT_FALSE(part->complete);
    EXPECT_EQ(part->key, whole->key);
    ASSERT_GT(part->planes.size(), 10U);
    for (std::size_t i = 0; i < part->planes.size(); ++i) {
      const MapletPlane& p = part->planes[i];
      EXPECT_EQ(p.plane.n, whole->planes[i].plane.n);
      EXPECT_EQ(p.covariance, whole->planes[i].covariance);
      // Coarse extents hold the exact ones and reach less than a block further.
      std::uint32_t lost = 0;
      for (int c = 0; c < p.grid.columns * p.grid.rows; ++c) {
        const int column = c % p.grid.columns;
        const int row = c / p.grid.columns;
        lost += whole->cell(whole->planes[i].grid, column, row) && !part->cell(p.grid, column, row);
      }
      EXPECT_EQ(lost, 0U);
      if (layer == 1) {
        EXPECT_EQ(p.grid.occupied, whole->planes[i].grid.occupied);
      }
    }
  }
}

TEST(Codec, SenderStopsAtItsBudget) {
  const auto in = large_maplet();
  const auto bytes = bytes_of(*in);
  std::vector<std::byte> out(kMaxMapletBytes);
  const auto m = std::make_unique<Maplet>();
  for (const std::size_t budget : {1024U, 4096U, 15360U}) {
    const auto size = encode(*in, budget, out);
    ASSERT_TRUE(size) << budget;
    EXPECT_LE(*size, budget);
    EXPECT_EQ(*size, layers_within(bytes, budget));
    EXPECT_TRUE(std::ranges::equal(std::span{out}.first(*size), std::span{bytes}.first(*size)));
    EXPECT_TRUE(decode(std::span{out}.first(*size), *m));
  }
  EXPECT_EQ(encode(*in, 100, out).error().code, ErrorCode::kCapacity);
  EXPECT_EQ(layers_within(std::span{bytes}.first(20), 4096), 0U);
}

TEST(Codec, UpIsCarriedWhenKnown) {
  const auto in = room_maplet();
  const auto out = std::make_unique<Maplet>();
  ASSERT_TRUE(decode(bytes_of(*in), *out));
  EXPECT_TRUE(out->up.isZero());
  in->up = Eigen::Vector3d{0.1, -0.99, 0.05}.normalized();
  ASSERT_TRUE(decode(bytes_of(*in), *out));
  EXPECT_LT(out->up.cross(in->up).norm(), codec::kMaxNormalError_rad);
}

TEST(Codec, EmptyMapletIsSmall) {
  Maplet m;
  m.keyframes.push_back({});
  const auto bytes = bytes_of(m);
  EXPECT_LE(bytes.size(), 52U);
  const auto out = std::make_unique<Maplet>();
  EXPECT_TRUE(decode(bytes, *out));
  EXPECT_TRUE(out->planes.empty());
}

TEST(Codec, RefusesWhatItCannotWrite) {
  std::vector<std::byte> out(kMaxMapletBytes);
  const auto m = std::make_unique<Maplet>();
  EXPECT_EQ(encode(*m, out).error().code, ErrorCode::kBadInput);
  auto room = room_maplet();
  EXPECT_EQ(encode(*room, std::span{out}.first(100)).error().code, ErrorCode::kCapacity);
  room->planes[2].plane.d = 1e6;
  EXPECT_EQ(encode(*room, out).error().code, ErrorCode::kBadInput);
  room->planes[2].plane.d = std::nan("");
  EXPECT_EQ(encode(*room, out).error().code, ErrorCode::kBadInput);
  room = room_maplet();
  room->planes[2].covariance(1, 1) = -1e-6;
  EXPECT_EQ(encode(*room, out).error().code, ErrorCode::kBadInput);
  for (const double cell_m : {std::nan(""), 0.0, -0.05, 1e9}) {
    room = room_maplet();
    room->cell_m = cell_m;
    EXPECT_EQ(encode(*room, out).error().code, ErrorCode::kBadInput) << cell_m;
  }
}

TEST(Codec, EveryCutAndEveryFlippedBitIsNoticed) {
  const auto bytes = bytes_of(*room_maplet());
  const auto m = std::make_unique<Maplet>();
  for (std::size_t n = 0; n < bytes.size(); n += n < 64 ? 1 : 17) {
    EXPECT_FALSE(decode(std::span{bytes}.first(n), *m)) << n;
  }
  for (std::size_t bit = 0; bit < bytes.size() * 8; bit += 13) {
    auto bad = bytes;
    bad[bit / 8] ^= static_cast<std::byte>(1U << (bit % 8));
    EXPECT_FALSE(decode(bad, *m)) << bit;
  }
}

TEST(Codec, NewerVersionIsNamedAsSuch) {
  auto bytes = bytes_of(*room_maplet());
  bytes[4] = std::byte{9};
  fix_checksums(bytes);
  const auto m = std::make_unique<Maplet>();
  const auto result = decode(bytes, *m);
  ASSERT_FALSE(result);
  EXPECT_STREQ(result.error().what,
               "maplet of a newer version than 2: this program is older than it");
}

// What decode() refuses is not written: a plane that has turned into its grid's axis.
TEST(Codec, APlaneThatTurnedAwayFromItsGridIsNotWritten) {
  const auto m = room_maplet();
  MapletPlane& plane = m->planes.front();
  const Eigen::Vector3d axis = Eigen::Vector3d::Unit(plane.grid.axis);
  plane.plane.n = (plane.plane.n + 3.0 * axis).normalized();
  std::vector<std::byte> bytes(100'000);
  EXPECT_FALSE(encode(*m, bytes));
}

// Garbage behind a valid checksum: any answer will do, as long as what comes out is sound.
TEST(Codec, HostileBytesStayInBounds) {
  const auto bytes = bytes_of(*room_maplet());
  std::mt19937 rng{3};
  const auto m = std::make_unique<Maplet>();
  int accepted = 0;
  for (int i = 0; i < 3000; ++i) {
    auto bad = bytes;
    for (int k = 0; k < 1 + i % 5; ++k) {
      bad[5 + rng() % (bad.size() - 9)] = static_cast<std::byte>(rng());
    }
    if (i % 7 == 0) bad.resize(40 + rng() % 400);
    fix_checksums(bad);
    if (!decode(bad, *m)) continue;
    ++accepted;
    for (const MapletPlane& p : m->planes) {
      EXPECT_TRUE(p.centre.allFinite() && p.covariance.allFinite());
      EXPECT_NEAR(p.plane.n.norm(), 1.0, 1e-9);
      EXPECT_LE(p.grid.first_bit + p.grid.columns * p.grid.rows, kMaxMapletCells);
    }
  }
  EXPECT_GT(accepted, 0);
}

TEST(Quantise, SingularCovarianceStaysUsable) {
  Eigen::Matrix3d ones = Eigen::Matrix3d::Ones();
  Eigen::Matrix3d out;
  ASSERT_TRUE(codec::unpack_covariance(codec::pack_covariance(ones), out));
  EXPECT_GT(out.determinant(), 0.0);
  ones(0, 1) = ones(1, 0) = -1.0;  // not a covariance at all
  ASSERT_TRUE(codec::unpack_covariance(codec::pack_covariance(ones), out));
  EXPECT_GT(out.determinant(), 0.0);
}

}  // namespace
}  // namespace maplet
