// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// The two documents of DDS Security 1.1, 9.4.1. Discovery and data are encrypted and signed; RTPS
// as a whole is not: that would be 12 bytes a datagram for heads that tell who speaks anyway.
#include <fmt/chrono.h>
#include <fmt/format.h>

#include <ctime>

#include "tools/keys/authority.hpp"

namespace maplet::keys {

namespace {

constexpr const char* kSchema =
    "xmlns:xsi=\"http://www.w3.org/2001/XMLSchema-instance\" "
    "xsi:noNamespaceSchemaLocation=\"https://www.omg.org/spec/DDS-SECURITY/20170901/";

std::string date(std::int64_t time_s) {
  return fmt::format("{:%Y-%m-%dT%H:%M:%S}Z", fmt::gmtime(static_cast<std::time_t>(time_s)));
}

}  // namespace

std::string governance_xml() {
  return fmt::format(R"(<?xml version="1.0" encoding="UTF-8"?>
<dds {}omg_shared_ca_governance.xsd">
  <domain_access_rules>
    <domain_rule>
      <domains><id_range><min>0</min><max>230</max></id_range></domains>
      <allow_unauthenticated_participants>false</allow_unauthenticated_participants>
      <enable_join_access_control>true</enable_join_access_control>
      <discovery_protection_kind>ENCRYPT</discovery_protection_kind>
      <liveliness_protection_kind>ENCRYPT</liveliness_protection_kind>
      <rtps_protection_kind>NONE</rtps_protection_kind>
      <topic_access_rules>
        <topic_rule>
          <topic_expression>*</topic_expression>
          <enable_discovery_protection>true</enable_discovery_protection>
          <enable_liveliness_protection>true</enable_liveliness_protection>
          <enable_read_access_control>true</enable_read_access_control>
          <enable_write_access_control>true</enable_write_access_control>
          <metadata_protection_kind>NONE</metadata_protection_kind>
          <data_protection_kind>ENCRYPT</data_protection_kind>
        </topic_rule>
      </topic_access_rules>
    </domain_rule>
  </domain_access_rules>
</dds>
)",
                     kSchema);
}

std::string permissions_xml(const std::string& subject, const Validity& validity) {
  const auto topics = [](const char* what) {
    return fmt::format("<{0}><topics><topic>maplet/air/*</topic></topics></{0}>", what);
  };
  return fmt::format(R"(<?xml version="1.0" encoding="UTF-8"?>
<dds {}omg_shared_ca_permissions.xsd">
  <permissions>
    <grant name="{}">
      <subject_name>CN={}</subject_name>
      <validity><not_before>{}</not_before><not_after>{}</not_after></validity>
      <allow_rule>
        <domains><id_range><min>0</min><max>230</max></id_range></domains>
        {}
        {}
      </allow_rule>
      <default>DENY</default>
    </grant>
  </permissions>
</dds>
)",
                     kSchema, subject, subject, date(validity.not_before_s),
                     date(validity.not_after_s), topics("publish"), topics("subscribe"));
}

}  // namespace maplet::keys
