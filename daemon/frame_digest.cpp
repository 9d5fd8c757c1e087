// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/frame_digest.hpp"

#include <array>
#include <span>

#include "core/base/crc.hpp"
#include "transport/exchange/record_codec.hpp"

namespace maplet::daemon {

namespace {

template <class Number>
void add(std::uint32_t& digest, const Number& value) noexcept {
  static_assert(std::is_arithmetic_v<Number> || std::is_enum_v<Number>);
  digest = crc32c(std::as_bytes(std::span{&value, 1}), digest);
}

void add_pose(std::uint32_t& digest, const Se3& T) noexcept {
  for (int i = 0; i < 3; ++i) add(digest, T.t[i]);
  for (int i = 0; i < 4; ++i) add(digest, T.q.coeffs()[i]);
}

}  // namespace

FrameDigest digest_of(const Step& step, std::span<const DeltaPoseRecord> records,
                      const Skeleton& skeleton) noexcept {
  FrameDigest d;
  if (step.patches != nullptr) {
    add(d.patches, step.patches->patches.size());
    for (const FramePlane& plane : step.patches->planes) {
      for (int i = 0; i < 3; ++i) add(d.patches, plane.theta[i]);
      for (int i = 0; i < 9; ++i) add(d.patches, plane.information.data()[i]);
      add(d.patches, plane.pixels);
    }
  }
  add(d.odometry, step.track.state);
  add_pose(d.odometry, step.track.T_odom_camera.se3);
  for (int i = 0; i < 36; ++i) add(d.odometry, step.track.covariance.data()[i]);
  add(d.maplet, step.keyframe != nullptr);
  if (step.closed != nullptr) d.maplet = crc32c(step.closed->bytes, d.maplet);
  for (const DeltaPoseRecord& record : records) {
    std::array<std::byte, kMaxRecordBytes> wire;
    ByteWriter out{wire};
    RecordContext context{0, 0};
    write_record(out, context, record);
    d.registration = crc32c(std::span{wire}.first(out.size()), d.registration);
    add(d.registration, record.overlap);
    add(d.registration, record.matches);
  }
  add(d.skeleton, skeleton.node_count());
  add(d.skeleton, skeleton.records_digest());
  add(d.skeleton, skeleton.chi2());
  return d;
}

}  // namespace maplet::daemon
