// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <atomic>
#include <boost/lockfree/spsc_queue.hpp>
#include <mutex>
#include <optional>
#include <span>
#include <string>
#include <thread>

#include "core/base/arena.hpp"
#include "daemon/journal/flush_budget.hpp"
#include "daemon/journal/store.hpp"
#include "daemon/radio_link.hpp"
#include "daemon/state_directory.hpp"

namespace maplet::daemon {

/// What `status` and `mission list` tell of the journal.
struct JournalStatus {
  enum class State : std::uint8_t {
    kOff,  ///< no state directory, or none that can be written
    kOn,
    kWaiting,  ///< the disk refuses: tried again, records wait
    kGivenUp,  ///< too much waits: the mission goes on in memory
    kRemoved,  ///< somebody removed the file: the same, and a later start begins another mission
    kMoved,    ///< somebody moved it: it is written where it is, a later start does not find it
  };
  State state = State::kOff;
  int error = 0;                                  ///< errno of the last refusal
  std::array<std::uint32_t, kStreams> flushed{};  ///< own records below these are safe
  std::uint64_t record_bytes = 0;                 ///< of records and maplets, as in the file
  std::uint64_t written_bytes = 0;                ///< handed to the disk, whole pages
  std::uint64_t carried_bytes = 0;                ///< of these, to change halves
  std::uint64_t flushes = 0;
  std::uint64_t waiting_bytes = 0;
  std::uint64_t held_back = 0;      ///< own records that will not be safe: they stay off the air
  std::uint64_t heard_dropped = 0;  ///< others' records that were not recorded
  std::uint32_t generation = 0;
};

/// A thread that writes the mission down, and lets own records go on the air once they are safe.
///
/// Memory   a bounded queue; three turns in the arena. Nothing later.
/// Threads  put() from the estimator's thread, without waiting and without allocation; status()
///   from any.
class JournalWriter {
 public:
  struct Config {
    std::size_t queue_bytes = 256 * 1024;
    journal::Keep keep;
  };
  /// @param file  reserved; outlives the writer
  JournalWriter(journal::BlockFile& file, const journal::Survey& survey, Life self,
                const Config& config, Arena& arena);
  ~JournalWriter();
  JournalWriter(const JournalWriter&) = delete;
  JournalWriter& operator=(const JournalWriter&) = delete;

  /// What it takes beside the arena.
  [[nodiscard]] static std::size_t bytes_beside(std::size_t queue_bytes) noexcept {
    return sizeof(JournalWriter) + queue_bytes;
  }

  /// @param radio  where own records go once they are safe; nullptr: nowhere
  void start(RadioLink* radio);
  /// Writes what waits. @return whether all is safe
  bool drain(Duration patience) noexcept;

  void put(const DeltaPoseRecord& record) noexcept;
  void put(const RangeRecord& record) noexcept;
  void put(const MapletKey& key, std::span<const std::byte> bytes, float saliency) noexcept;
  void put(const journal::Part& part) noexcept;
  void put(const journal::Decision& decision) noexcept;
  /// A piece of a snapshot; dropped where there is little room.
  void put(const journal::Poses& piece) noexcept;

  /// For a run that outpaces the disk: waits until much may be put.
  void wait_for_room() const noexcept;

  [[nodiscard]] JournalStatus status() const;

 private:
  struct Item {  // in the queue: then `bytes` octets
    journal::ItemKind kind{};
    bool first = false;  ///< of a snapshot
    float saliency = 0.0F;
    std::uint32_t bytes = 0;
    MapletKey key;
    std::uint64_t digest = 0;
  };
  class Air;

  template <class Value>
  void push(journal::ItemKind kind, const Value& value, bool own) noexcept;
  [[nodiscard]] bool push(const Item& item, std::span<const std::byte> bytes, bool own) noexcept;
  [[nodiscard]] bool is_own(const RecordKey& key) const noexcept {
    return Life{key.agent, key.epoch} == self_;
  }

  void loop() noexcept;
  /// Fills the turn. @return whether it is full
  bool take() noexcept;
  [[nodiscard]] bool pop() noexcept;
  [[nodiscard]] bool add_popped() noexcept;
  void write(Instant now) noexcept;
  void refused(Instant now) noexcept;
  void look_for_file(Instant now) noexcept;
  void say(std::span<const std::byte> payload) noexcept;
  void note() noexcept;
  /// What a later start finds.
  [[nodiscard]] std::array<std::uint32_t, kStreams> acknowledged() const noexcept {
    return removed_ || moved_ ? std::array<std::uint32_t, kStreams>{} : safe_ends_;
  }

  journal::BlockFile& file_;
  Life self_;
  Config config_;
  std::span<std::byte> buffer_;
  std::span<std::byte> scratch_;
  std::span<std::byte> popped_bytes_;
  journal::Store store_;
  journal::TurnBuilder turn_;
  MonotonicClock clock_;  // the budget begins with its time
  journal::FlushBudget budget_;
  RadioLink* radio_ = nullptr;

  boost::lockfree::spsc_queue<std::byte> queue_;
  std::size_t capacity_;
  std::optional<Item> popped_;  ///< out of the queue, not in a turn yet
  std::array<std::uint32_t, kStreams> safe_ends_{};
  Instant retry_at_{};
  std::uint64_t news_ = 0;  ///< bytes of the turn that are records or maplets
  Instant look_at_{};
  bool said_given_up_ = false;
  bool removed_ = false;  ///< nothing is written any more, and nothing has to wait for it
  bool moved_ = false;    ///< written as before, but no later start finds it
  bool good_ = true;      ///< the disk took the last turn

  std::atomic<bool> given_up_{false};
  std::atomic<bool> stop_{false};
  std::atomic<bool> hurry_{false};  ///< drain()
  std::atomic<bool> idle_{false};
  std::atomic<std::uint64_t> held_back_{0};
  std::atomic<std::uint64_t> heard_dropped_{0};

  mutable std::mutex mutex_;
  JournalStatus status_;
  std::thread thread_;
};

}  // namespace maplet::daemon
