// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
// Included by this folder's sources only.
#pragma once

#include <dds/dds.h>

#include <memory>

namespace maplet {

struct DeleteRosQos {
  void operator()(dds_qos_t* qos) const noexcept { dds_delete_qos(qos); }
};

/// @param keeps  the last `history` samples for late subscribers that ask for them
/// (TRANSIENT_LOCAL);
///   others get what is written from then on
inline std::unique_ptr<dds_qos_t, DeleteRosQos> ros_qos(bool reliable, int history,
                                                        bool keeps) noexcept {
  std::unique_ptr<dds_qos_t, DeleteRosQos> qos{dds_create_qos()};
  dds_qset_reliability(qos.get(), reliable ? DDS_RELIABILITY_RELIABLE : DDS_RELIABILITY_BEST_EFFORT,
                       DDS_MSECS(100));
  dds_qset_durability(qos.get(), keeps ? DDS_DURABILITY_TRANSIENT_LOCAL : DDS_DURABILITY_VOLATILE);
  dds_qset_history(qos.get(), DDS_HISTORY_KEEP_LAST, history);
  if (keeps) {
    dds_qset_durability_service(qos.get(), 0, DDS_HISTORY_KEEP_LAST, history, DDS_LENGTH_UNLIMITED,
                                DDS_LENGTH_UNLIMITED, DDS_LENGTH_UNLIMITED);
  }
  dds_qset_writer_data_lifecycle(qos.get(), false);
  return qos;
}

}  // namespace maplet
