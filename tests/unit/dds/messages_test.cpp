// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "transport/dds/messages.hpp"

#include <dds/ddsi/ddsi_serdata.h>
#include <gtest/gtest.h>

#include <vector>

#include "tests/support/records.hpp"
#include "tests/unit/dds/own_domain.hpp"
#include "transport/dds/domain.hpp"

namespace maplet {
namespace {

TEST(Messages, DeltaPoseRoundTrip) {
  std::mt19937 rng{1};
  for (std::uint32_t i = 0; i < 20; ++i) {
    DeltaPose delta = test::random_delta(rng, 40000, 4000000000U, i);
    delta.kind = i % 2 == 0 ? DeltaPose::Kind::kClosure : DeltaPose::Kind::kConsecutive;
    const auto record = quantise(delta, 40000, 4000000000U, i);
    ASSERT_TRUE(record);
    EXPECT_EQ(from_message(to_message(*record)), *record);
  }
}

TEST(Messages, MapletRoundTrip) {
  const std::vector<std::byte> bytes{std::byte{1}, std::byte{2}};
  const MapletRecord record{{1, 2, 3}, Stamp{4}, 5, 6, bytes};
  const MapletRecord back = from_message(to_message(record));
  EXPECT_EQ(back.key, record.key);
  EXPECT_EQ(back.stamp, record.stamp);
  EXPECT_EQ(back.planes, 5);
  EXPECT_EQ(back.keyframes, 6);
  EXPECT_TRUE(std::equal(back.bytes.begin(), back.bytes.end(), bytes.begin(), bytes.end()));
}

TEST(Messages, StatusRoundTrip) {
  StatusRecord record;
  std::uint32_t n = 1;
  record.agent = 9;
  record.epoch = n++;
  record.state = StatusRecord::State::kDegraded;
  record.tracking = true;
  record.stamp = Stamp{n++};
  for (auto* count :
       {&record.uptime_ms, &record.frames_read, &record.frames_processed, &record.frames_dropped,
        &record.frames_lost, &record.arena_bytes, &record.rss_bytes}) {
    *count = n++;
  }
  for (auto* count : {&record.keyframes, &record.maplets, &record.delta_poses, &record.closures,
                      &record.nodes, &record.factors, &record.messages_dropped}) {
    *count = n++;
  }
  for (auto& stage : record.stages) stage = {n++, n++, n++, n++};
  EXPECT_EQ(from_message(to_message(record)), record);
}

TEST(Messages, DeltaPosePayloadIsAsStated) {
  auto domain = DdsDomain::open(test::own_domain(), DdsDomain::Role::kDaemon, 9);
  ASSERT_TRUE(domain) << domain.error().what;
  const dds_entity_t topic = make_topic(domain->participant(), TopicKind::kDeltaPose);
  const dds_entity_t reader = make_reader(domain->participant(), topic, 4);
  const dds_entity_t writer = make_writer(domain->participant(), topic, 4);
  ASSERT_GT(writer, 0);
  std::mt19937 rng{2};
  const auto message = to_message(*quantise(test::random_delta(rng), 1, 2, 3));
  ASSERT_EQ(dds_write(writer, &message), DDS_RETCODE_OK);
  ddsi_serdata* serialised = nullptr;
  dds_sample_info_t info;
  ASSERT_EQ(dds_takecdr(reader, &serialised, 1, &info, DDS_ANY_STATE), 1);
  EXPECT_EQ(ddsi_serdata_size(serialised), kDeltaPosePayloadBytes);
  EXPECT_LE(kDeltaPosePayloadBytes, 160U);
  ddsi_serdata_unref(serialised);
}

}  // namespace
}  // namespace maplet
