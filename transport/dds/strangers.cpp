// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "transport/dds/strangers.hpp"

#include <dds/dds.h>

#include <algorithm>

namespace maplet {

namespace {

constexpr Duration kHandshake = std::chrono::seconds{10};

}  // namespace

Strangers::Strangers(std::int32_t participant, std::int32_t reader) noexcept
    : reader_{reader},
      participants_{
          dds_create_reader(participant, DDS_BUILTIN_TOPIC_DCPSPARTICIPANT, nullptr, nullptr)} {
  (void)dds_get_instance_handle(participant, &own_);
}

Strangers::Seen* Strangers::find_or_add(std::uint64_t handle, Instant now) noexcept {
  const auto at = std::ranges::find(seen_, handle, &Seen::handle);
  if (at != seen_.end()) return &*at;
  const auto place = std::ranges::find(seen_, std::uint64_t{0}, &Seen::handle);
  if (place == seen_.end()) return nullptr;
  *place = {handle, now, false, false};
  return &*place;
}

void Strangers::look(Instant now) noexcept {
  std::array<dds_instance_handle_t, kMost> friends{};
  std::size_t friend_count = 0;
  std::array<dds_instance_handle_t, kMost> writers{};
  const dds_return_t matched = dds_get_matched_publications(reader_, writers.data(), kMost);
  for (int i = 0; i < std::min<int>(matched, kMost); ++i) {
    dds_builtintopic_endpoint_t* writer =
        dds_get_matched_publication_data(reader_, writers[static_cast<std::size_t>(i)]);
    if (writer == nullptr) continue;
    friends[friend_count++] = writer->participant_instance_handle;
    dds_builtintopic_free_endpoint(writer);
  }
  for (Seen& seen : seen_) seen.there = false;
  std::array<void*, kMost> samples{};
  std::array<dds_sample_info_t, kMost> infos{};
  const dds_return_t count = dds_read(participants_, samples.data(), infos.data(), kMost, kMost);
  for (int i = 0; i < count; ++i) {
    const dds_sample_info_t& info = infos[static_cast<std::size_t>(i)];
    const bool alive = info.instance_state == DDS_ALIVE_INSTANCE_STATE;
    if (!alive || info.instance_handle == own_) continue;
    Seen* seen = find_or_add(info.instance_handle, now);
    if (seen == nullptr) continue;
    seen->there = true;
    const auto end = friends.begin() + static_cast<std::ptrdiff_t>(friend_count);
    if (std::find(friends.begin(), end, info.instance_handle) != end) {
      seen->first = now;
    } else if (!seen->counted && now - seen->first > kHandshake) {
      seen->counted = true;
      ++count_;
    }
  }
  if (count > 0) (void)dds_return_loan(participants_, samples.data(), count);
  for (Seen& seen : seen_) {
    if (!seen.there) seen = {};
  }
}

}  // namespace maplet
