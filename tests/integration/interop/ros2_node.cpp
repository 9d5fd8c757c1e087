// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// A ROS 2 node of somebody else's, as rmw_fastrtps makes one: reads what mapletd publishes, a line
// of JSON a sample, and writes odometry that a file holds.
//     fastdds_ros2_node DOMAIN SECONDS [ODOMETRY_FILE TOPIC]
// A line of the file: RELEASE STAMP FRAME CHILD x y z qx qy qz qw SIGMA COPIES. It goes out when
// mapletd's newest odometry is half a second from RELEASE; SIGMA of the twist, 0: not said.
#include <fastdds/rtps/transport/UDPv4TransportDescriptor.h>

#include <chrono>
#include <cinttypes>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <fastdds/dds/domain/DomainParticipant.hpp>
#include <fastdds/dds/domain/DomainParticipantFactory.hpp>
#include <fastdds/dds/publisher/DataWriter.hpp>
#include <fastdds/dds/publisher/Publisher.hpp>
#include <fastdds/dds/subscriber/DataReader.hpp>
#include <fastdds/dds/subscriber/SampleInfo.hpp>
#include <fastdds/dds/subscriber/Subscriber.hpp>
#include <fastdds/dds/topic/TypeSupport.hpp>
#include <fstream>
#include <sstream>
#include <string>
#include <thread>
#include <vector>

#include "ros2_msgPubSubTypes.h"

namespace {

using namespace eprosima::fastdds::dds;
using eprosima::fastrtps::rtps::PREALLOCATED_WITH_REALLOC_MEMORY_MODE;

double stamp_s(const builtin_interfaces::msg::dds_::Time_& t) {
  return t.sec() + 1e-9 * t.nanosec();
}

void print_pose(const geometry_msgs::msg::dds_::Pose_& p) {
  std::printf("[%.9g,%.9g,%.9g,%.9g,%.9g,%.9g,%.9g]", p.position().x(), p.position().y(),
              p.position().z(), p.orientation().x(), p.orientation().y(), p.orientation().z(),
              p.orientation().w());
}

template <class Array>
void print_numbers(const Array& numbers) {
  const char* between = "";
  std::putchar('[');
  for (const double n : numbers) {
    std::printf("%s%.9g", between, n);
    between = ",";
  }
  std::putchar(']');
}

void print(const nav_msgs::msg::dds_::Odometry_& m) {
  std::printf(R"({"kind":"odometry","stamp":%.9f,"frame":"%s","child":"%s","pose":)",
              stamp_s(m.header().stamp()), m.header().frame_id().c_str(),
              m.child_frame_id().c_str());
  print_pose(m.pose().pose());
  std::printf(",\"covariance\":");
  print_numbers(m.pose().covariance());
  const auto& t = m.twist().twist();
  std::printf(",\"twist\":[%.9g,%.9g,%.9g,%.9g,%.9g,%.9g],\"twist_covariance\":", t.linear().x(),
              t.linear().y(), t.linear().z(), t.angular().x(), t.angular().y(), t.angular().z());
  print_numbers(m.twist().covariance());
  std::printf("}\n");
}

void print(const tf2_msgs::msg::dds_::TFMessage_& m) {
  std::printf(R"({"kind":"tf","transforms":[)");
  const char* between = "";
  for (const auto& t : m.transforms()) {
    const auto& v = t.transform().translation();
    const auto& q = t.transform().rotation();
    std::printf(
        R"(%s{"stamp":%.9f,"frame":"%s","child":"%s","T":[%.9g,%.9g,%.9g,%.9g,%.9g,%.9g,%.9g]})",
        between, stamp_s(t.header().stamp()), t.header().frame_id().c_str(),
        t.child_frame_id().c_str(), v.x(), v.y(), v.z(), q.x(), q.y(), q.z(), q.w());
    between = ",";
  }
  std::printf("]}\n");
}

void print(const nav_msgs::msg::dds_::Path_& m) {
  std::printf(R"({"kind":"path","frame":"%s","poses":[)", m.header().frame_id().c_str());
  const char* between = "";
  for (const auto& p : m.poses()) {
    std::printf("%s{\"stamp\":%.9f,\"frame\":\"%s\",\"pose\":", between,
                stamp_s(p.header().stamp()), p.header().frame_id().c_str());
    print_pose(p.pose());
    std::putchar('}');
    between = ",";
  }
  std::printf("]}\n");
}

void print(const visualization_msgs::msg::dds_::MarkerArray_& m) {
  std::printf(R"({"kind":"markers","markers":[)");
  const char* between = "";
  for (const auto& marker : m.markers()) {
    std::printf(R"(%s{"ns":"%s","id":%d,"type":%d,"action":%d,"frame":"%s","alpha":%.3g,"pose":)",
                between, marker.ns().c_str(), marker.id(), marker.type(), marker.action(),
                marker.header().frame_id().c_str(), marker.color().a());
    print_pose(marker.pose());
    std::printf(",\"points\":[");
    const char* comma = "";
    for (const auto& p : marker.points()) {
      std::printf("%s[%.6g,%.6g,%.6g]", comma, p.x(), p.y(), p.z());
      comma = ",";
    }
    std::printf("]}");
    between = ",";
  }
  std::printf("]}\n");
}

void print(const diagnostic_msgs::msg::dds_::DiagnosticArray_& m) {
  for (const auto& s : m.status()) {
    std::printf(R"({"kind":"diagnostics","level":%d,"name":"%s","message":"%s","hardware":"%s",)",
                s.level(), s.name().c_str(), s.message().c_str(), s.hardware_id().c_str());
    std::printf("\"values\":{");
    const char* between = "";
    for (const auto& v : s.values()) {
      std::printf(R"(%s"%s":"%s")", between, v.key().c_str(), v.value().c_str());
      between = ",";
    }
    std::printf("}}\n");
  }
}

/// A subscription as `create_subscription<T>(name, 10)` makes it.
template <class Message, class Type>
class Subscription {
 public:
  Subscription(DomainParticipant& participant, Subscriber& subscriber, const char* topic) {
    TypeSupport type{new Type};
    type.register_type(&participant);
    Topic* made = participant.create_topic(topic, type.get_type_name(), TOPIC_QOS_DEFAULT);
    DataReaderQos qos = DATAREADER_QOS_DEFAULT;
    qos.reliability().kind = RELIABLE_RELIABILITY_QOS;
    qos.durability().kind = VOLATILE_DURABILITY_QOS;
    qos.history().kind = KEEP_LAST_HISTORY_QOS;
    qos.history().depth = 10;
    qos.endpoint().history_memory_policy = PREALLOCATED_WITH_REALLOC_MEMORY_MODE;
    reader_ = subscriber.create_datareader(made, qos);
  }
  /// @param look  called with each
  template <class Look>
  void take(Look&& look) {
    Message message;
    SampleInfo info;
    while (reader_ != nullptr &&
           reader_->take_next_sample(&message, &info) == ReturnCode_t::RETCODE_OK) {
      if (!info.valid_data) continue;
      print(message);
      look(message);
    }
  }

 private:
  DataReader* reader_ = nullptr;
};

struct Line {
  double release_s = 0.0;
  int copies = 1;
  nav_msgs::msg::dds_::Odometry_ message;
};

std::vector<Line> read_lines(const char* file) {
  std::vector<Line> lines;
  std::ifstream in{file};
  for (std::string text; std::getline(in, text);) {
    std::istringstream words{text};
    std::vector<std::string> w;
    for (std::string word; words >> word;) w.push_back(word);
    if (w.size() != 13) continue;
    const auto number = [&](std::size_t i) { return std::strtod(w[i].c_str(), nullptr); };
    Line line;
    line.release_s = number(0);
    line.copies = std::atoi(w[12].c_str());
    auto& m = line.message;
    const double stamp = number(1);
    m.header().stamp().sec(static_cast<std::int32_t>(std::floor(stamp)));
    m.header().stamp().nanosec(
        static_cast<std::uint32_t>(std::llround((stamp - std::floor(stamp)) * 1e9)));
    m.header().frame_id(w[2] == "-" ? "" : w[2]);
    m.child_frame_id(w[3] == "-" ? "" : w[3]);
    auto& p = m.pose().pose();
    p.position().x(number(4));
    p.position().y(number(5));
    p.position().z(number(6));
    p.orientation().x(number(7));
    p.orientation().y(number(8));
    p.orientation().z(number(9));
    p.orientation().w(number(10));
    const double sigma = number(11);
    for (std::size_t i = 0; i < 6; ++i) m.twist().covariance()[7 * i] = sigma * sigma;
    lines.push_back(line);
  }
  return lines;
}

DomainParticipant* open(int domain) {
  DomainParticipantQos qos;
  auto* factory = DomainParticipantFactory::get_instance();
  const char* local = std::getenv("ROS_LOCALHOST_ONLY");
  const bool everywhere = local != nullptr && std::strcmp(local, "0") == 0;
  if (everywhere) return factory->create_participant(static_cast<std::uint32_t>(domain), qos);
  qos.transport().use_builtin_transports = false;
  auto udp = std::make_shared<eprosima::fastdds::rtps::UDPv4TransportDescriptor>();
  udp->interfaceWhiteList.emplace_back("127.0.0.1");
  qos.transport().user_transports.push_back(udp);
  return factory->create_participant(static_cast<std::uint32_t>(domain), qos);
}

}  // namespace

int main(int argc, char** argv) {
  if (argc != 3 && argc != 5) return 2;
  DomainParticipant* participant = open(std::atoi(argv[1]));
  if (participant == nullptr) return 1;
  using namespace std::chrono;
  Subscriber& subscriber = *participant->create_subscriber(SUBSCRIBER_QOS_DEFAULT);
  Subscription<nav_msgs::msg::dds_::Odometry_, nav_msgs::msg::dds_::Odometry_PubSubType> odometry{
      *participant, subscriber, "rt/odom"};
  Subscription<tf2_msgs::msg::dds_::TFMessage_, tf2_msgs::msg::dds_::TFMessage_PubSubType> tf{
      *participant, subscriber, "rt/tf"};
  Subscription<nav_msgs::msg::dds_::Path_, nav_msgs::msg::dds_::Path_PubSubType> path{
      *participant, subscriber, "rt/path"};
  Subscription<visualization_msgs::msg::dds_::MarkerArray_,
               visualization_msgs::msg::dds_::MarkerArray_PubSubType>
      map{*participant, subscriber, "rt/map_markers"};
  Subscription<diagnostic_msgs::msg::dds_::DiagnosticArray_,
               diagnostic_msgs::msg::dds_::DiagnosticArray_PubSubType>
      diagnostics{*participant, subscriber, "rt/diagnostics"};

  std::vector<Line> lines;
  DataWriter* writer = nullptr;
  if (argc == 5) {
    lines = read_lines(argv[3]);
    // The type is registered under its name already.
    Topic* topic = participant->create_topic(
        argv[4], nav_msgs::msg::dds_::Odometry_PubSubType{}.getName(), TOPIC_QOS_DEFAULT);
    DataWriterQos qos = DATAWRITER_QOS_DEFAULT;
    qos.reliability().kind = RELIABLE_RELIABILITY_QOS;
    qos.durability().kind = VOLATILE_DURABILITY_QOS;
    qos.history().kind = KEEP_LAST_HISTORY_QOS;
    qos.history().depth = 10;
    qos.endpoint().history_memory_policy = PREALLOCATED_WITH_REALLOC_MEMORY_MODE;
    qos.publish_mode().kind = SYNCHRONOUS_PUBLISH_MODE;
    writer = participant->create_publisher(PUBLISHER_QOS_DEFAULT)->create_datawriter(topic, qos);
    if (writer == nullptr) return 1;
  }

  constexpr double kAheadS = 0.5;
  double newest_s = 0.0;
  bool heard = false;
  std::size_t next = 0;
  const auto nothing = [](const auto&) {};
  const auto end = steady_clock::now() + duration<double>{std::atof(argv[2])};
  while (steady_clock::now() < end) {
    odometry.take([&](const auto& m) {
      newest_s = stamp_s(m.header().stamp());
      heard = true;
    });
    tf.take(nothing);
    path.take(nothing);
    map.take(nothing);
    diagnostics.take(nothing);
    std::fflush(stdout);
    for (; heard && next < lines.size() && lines[next].release_s < newest_s + kAheadS; ++next)
      for (int i = 0; i < lines[next].copies; ++i) writer->write(&lines[next].message);
    std::this_thread::sleep_for(milliseconds{5});
  }
  participant->delete_contained_entities();
  DomainParticipantFactory::get_instance()->delete_participant(participant);
  return 0;
}
