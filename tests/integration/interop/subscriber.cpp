// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// A program of somebody else's: reads maplet/delta_pose with Fast DDS and prints a line a sample.
//     fastdds_subscriber DOMAIN COUNT TIMEOUT_S
#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>

#include <chrono>
#include <cinttypes>
#include <cstdio>
#include <cstdlib>
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/topic/TypeSupport.hpp>
#include <thread>

#include "maplet_msgPubSubTypes.h"

namespace {

using namespace eprosima::fastdds::dds;

DomainParticipant* open(int domain) {
  // Loopback only.
  DomainParticipantQos qos;
  qos.transport().use_builtin_transports = false;
  auto udp = std::make_shared<eprosima::fastdds::rtps::UDPv4TransportDescriptor>();
  udp->interfaceWhiteList.emplace_back("127.0.0.1");
  qos.transport().user_transports.push_back(udp);
  return DomainParticipantFactory::get_instance()->create_participant(
      static_cast<std::uint32_t>(domain), qos);
}

void print(const maplet::msg::DeltaPose& m) {
  std::printf("%u %" PRIu32 " %u %" PRIu32 " %u:%" PRIu32 " %u:%" PRIu32 " %" PRId64 " %" PRId64,
              m.agent(), m.epoch(), m.stream(), m.seq(), m.a().agent(), m.a().id(), m.b().agent(),
              m.b().id(), m.stamp_a_ns(), m.stamp_b_ns());
  for (const float v : m.translation_m()) std::printf(" %.9g", v);
  for (const float v : m.sigma()) std::printf(" %.9g", v);
  std::printf(" %d %u %u\n", m.shape()[14], m.pivot()[4], m.matches());
}

}  // namespace

int main(int argc, char** argv) {
  if (argc < 4) return 2;
  const int count = std::atoi(argv[2]);
  DomainParticipant* participant = open(std::atoi(argv[1]));
  if (participant == nullptr) return 1;
  TypeSupport type{new maplet::msg::DeltaPosePubSubType};
  // Cyclone writes the IDL's name.
  type->setName("maplet::msg::DeltaPose");
  type.register_type(participant);
  Topic* topic =
      participant->create_topic("maplet/delta_pose", "maplet::msg::DeltaPose", TOPIC_QOS_DEFAULT);
  DataReaderQos qos;
  qos.reliability().kind = RELIABLE_RELIABILITY_QOS;
  qos.durability().kind = TRANSIENT_LOCAL_DURABILITY_QOS;
  qos.history().kind = KEEP_ALL_HISTORY_QOS;
  Subscriber* subscriber = participant->create_subscriber(SUBSCRIBER_QOS_DEFAULT);
  DataReader* reader = subscriber->create_datareader(topic, qos);
  if (reader == nullptr) return 1;
  const auto end = std::chrono::steady_clock::now() + std::chrono::seconds{std::atoi(argv[3])};
  int got = 0;
  while (got < count && std::chrono::steady_clock::now() < end) {
    maplet::msg::DeltaPose message;
    SampleInfo info;
    if (reader->take_next_sample(&message, &info) != ReturnCode_t::RETCODE_OK) {
      std::this_thread::sleep_for(std::chrono::milliseconds{10});
      continue;
    }
    if (!info.valid_data) continue;
    print(message);
    ++got;
  }
  std::fflush(stdout);
  // Leaves with a word: a publisher that waits for acknowledgements would wait for this reader.
  participant->delete_contained_entities();
  DomainParticipantFactory::get_instance()->delete_participant(participant);
  return got == count ? 0 : 1;
}
