// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "transport/dds/arrivals.hpp"

namespace maplet {

Arrivals::Arrivals(dds_entity_t participant, dds_entity_t writer) noexcept
    : participants_{dds_create_reader(participant, DDS_BUILTIN_TOPIC_DCPSPARTICIPANT, nullptr,
                                      nullptr)},
      writer_{writer},
      last_{MonotonicClock{}.now()} {}

Duration Arrivals::quiet_for(Instant now) noexcept {
  void* samples[8] = {};
  dds_sample_info_t infos[8];
  for (int count = 8; count == 8;) {
    samples[0] = nullptr;  // a loan
    count = dds_take(participants_, samples, infos, 8, 8);
    for (int i = 0; i < count; ++i) {
      // Seen now for the first time, but it came when its announcement did.
      const Instant came = now - (Duration{dds_time()} - Duration{infos[i].source_timestamp});
      if (infos[i].valid_data && came > last_ && came <= now) last_ = came;
    }
    if (count > 0) dds_return_loan(participants_, samples, count);
  }
  dds_publication_matched_status_t matched{};
  if (dds_get_publication_matched_status(writer_, &matched) == DDS_RETCODE_OK &&
      matched.total_count != matches_) {
    matches_ = matched.total_count;
    last_ = now;
  }
  return now - last_;
}

}  // namespace maplet
