// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/journal_writer.hpp"

#include <fmt/format.h>

#include <algorithm>
#include <cstring>
#include <utility>

#include "daemon/alloc_counter.hpp"
#include "daemon/log.hpp"
#include "daemon/thread_setup.hpp"

namespace maplet::daemon {

using journal::ItemKind;
using journal::kMaxTurnBytes;

namespace {

using namespace std::chrono_literals;

constexpr Duration kNap = 20ms;

}  // namespace

/// Own records of a turn that is safe go on the air.
class JournalWriter::Air final : public journal::Visitor {
 public:
  Air(RadioLink& radio, Life self, const std::atomic<bool>& stop) noexcept
      : radio_{radio}, self_{self}, stop_{stop} {}
  void take(const DeltaPoseRecord& record) noexcept override { say(record); }
  void take(const RangeRecord& record) noexcept override { say(record); }
  void take(const MapletKey& key, float saliency,
            std::span<const std::byte> bytes) noexcept override {
    insist([&] { return radio_.publish(key, bytes, saliency); });
  }

 private:
  template <class Record>
  void say(const Record& record) noexcept {
    if (Life{record.key.agent, record.key.epoch} == self_)
      insist([&] { return radio_.publish(record); });
  }
  template <class Say>
  void insist(Say&& say) const noexcept {
    for (int i = 0; i < 100 && !say() && !stop_; ++i) std::this_thread::sleep_for(10ms);
  }
  RadioLink& radio_;
  Life self_;
  const std::atomic<bool>& stop_;
};

JournalWriter::JournalWriter(journal::BlockFile& file, const journal::Survey& survey, Life self,
                             const Config& config, Arena& arena)
    : file_{file},
      self_{self},
      config_{config},
      buffer_{arena.make_array<std::byte>(kMaxTurnBytes, "journal/turn")},
      scratch_{arena.make_array<std::byte>(2 * kMaxTurnBytes, "journal/change of halves")},
      popped_bytes_{arena.make_array<std::byte>(kMaxMapletBytes, "journal/item")},
      store_{file, scratch_},
      turn_{buffer_, self},
      budget_{clock_.now()},
      queue_{config.queue_bytes},
      capacity_{config.queue_bytes} {
  status_.state = JournalStatus::State::kOn;
  budget_.wrote(static_cast<std::size_t>(journal::FlushBudget::kMost) -
                journal::kPageBytes);  // one page to begin with
  if (survey.state == journal::Survey::State::kGood) {
    good_ = store_.go_on(survey, config_.keep);
    turn_.know_ends(survey.ends);
    safe_ends_ = survey.ends;
  } else {
    store_.begin(self, survey.half_pages);
  }
  note();
}

JournalWriter::~JournalWriter() {
  stop_ = true;
  if (thread_.joinable()) thread_.join();
}

void JournalWriter::start(RadioLink* radio) {
  radio_ = radio;
  thread_ = start_thread("journal", [this] {
    watch_this_thread();
    loop();
  });
}

bool JournalWriter::push(const Item& item, std::span<const std::byte> bytes, bool own) noexcept {
  // Others can be asked again: their records leave room for ours.
  const std::size_t spare = own ? 0 : capacity_ / 2;
  if (given_up_ || queue_.write_available() < sizeof item + bytes.size() + spare) {
    if (!own) {
      ++heard_dropped_;
      return false;
    }
    given_up_ = true;
    ++held_back_;
    return false;
  }
  queue_.push(reinterpret_cast<const std::byte*>(&item), sizeof item);
  queue_.push(bytes.data(), bytes.size());
  return true;
}

template <class Value>
void JournalWriter::push(ItemKind kind, const Value& value, bool own) noexcept {
  static_assert(std::is_trivially_copyable_v<Value>);
  Item item;
  item.kind = kind;
  item.bytes = sizeof value;
  (void)push(item, std::as_bytes(std::span{&value, 1}), own);
}

void JournalWriter::put(const DeltaPoseRecord& record) noexcept {
  push(ItemKind::kDeltaPose, record, is_own(record.key));
}
void JournalWriter::put(const RangeRecord& record) noexcept {
  push(ItemKind::kRange, record, is_own(record.key));
}
void JournalWriter::put(const MapletKey& key, std::span<const std::byte> bytes,
                        float saliency) noexcept {
  Item item;
  item.kind = ItemKind::kMaplet;
  item.saliency = saliency;
  item.bytes = static_cast<std::uint32_t>(bytes.size());
  item.key = key;
  (void)push(item, bytes, true);
}
void JournalWriter::put(const journal::Part& part) noexcept { push(ItemKind::kPart, part, true); }
void JournalWriter::put(const journal::Decision& decision) noexcept {
  push(ItemKind::kDecision, decision, true);
}
void JournalWriter::put(const journal::Poses& piece) noexcept {
  static_assert(std::is_trivially_destructible_v<journal::NodePose>, "numbers only");
  Item item;
  item.kind = ItemKind::kPoses;
  item.first = piece.first;
  item.digest = piece.records_digest;
  const auto bytes = std::as_bytes(piece.poses);
  item.bytes = static_cast<std::uint32_t>(bytes.size());
  (void)push(item, bytes, false);
}

bool JournalWriter::pop() noexcept {
  Item item;
  if (queue_.read_available() < sizeof item) return false;
  queue_.pop(reinterpret_cast<std::byte*>(&item), sizeof item);
  while (queue_.read_available() < item.bytes) std::this_thread::yield();  // its second push
  queue_.pop(popped_bytes_.data(), item.bytes);
  popped_ = item;
  return true;
}

template <class Value>
static Value value_of(std::span<const std::byte> bytes) noexcept {
  Value value;
  std::memcpy(static_cast<void*>(&value), bytes.data(), sizeof value);
  return value;
}

bool JournalWriter::add_popped() noexcept {
  const std::span<const std::byte> bytes = popped_bytes_.first(popped_->bytes);
  switch (popped_->kind) {
    case ItemKind::kDeltaPose:
      return turn_.add(value_of<DeltaPoseRecord>(bytes));
    case ItemKind::kRange:
      return turn_.add(value_of<RangeRecord>(bytes));
    case ItemKind::kMaplet:
      return turn_.add(popped_->key, popped_->saliency, bytes);
    case ItemKind::kPart:
      return turn_.add(value_of<journal::Part>(bytes));
    case ItemKind::kDecision:
      return turn_.add(value_of<journal::Decision>(bytes));
    case ItemKind::kPoses: {
      std::array<journal::NodePose, journal::Poses::kMost> poses;
      const std::size_t count = bytes.size() / sizeof poses[0];
      for (std::size_t i = 0; i < count; ++i)
        poses[i] = value_of<journal::NodePose>(bytes.subspan(i * sizeof poses[0]));
      return turn_.add(
          journal::Poses{popped_->digest, popped_->first, std::span{poses}.first(count)});
    }
  }
  return true;
}

bool JournalWriter::take() noexcept {
  while (popped_ || pop()) {
    const std::size_t before = turn_.payload_bytes();
    if (!add_popped()) return true;
    // Snapshots and starts are no news: they are paid from what is allowed a minute.
    if (popped_->kind != ItemKind::kPoses && popped_->kind != ItemKind::kPart) {
      news_ += turn_.payload_bytes() - before;
      budget_.recorded(turn_.payload_bytes() - before);
    }
    popped_.reset();
  }
  return false;
}

void JournalWriter::loop() noexcept {
  while (true) {
    const bool stopping = stop_;
    const bool full = take();
    const Instant now = clock_.now();
    const auto pages =
        static_cast<std::size_t>(journal::pages_of(turn_.payload_bytes()) * journal::kPageBytes);
    look_for_file(now);
    const bool due = full || hurry_ || stopping || removed_ || budget_.allows(pages, now);
    if (!turn_.empty() && due && (good_ || now >= retry_at_ || stopping)) write(now);
    idle_ = turn_.empty() && !popped_ && queue_.read_available() == 0;
    note();
    if (stopping && (idle_ || !good_)) return;
    if (!full || !good_) std::this_thread::sleep_for(kNap);
  }
}

void JournalWriter::write(Instant now) noexcept {
  look_at_ = now;
  look_for_file(now);
  if (removed_) {  // the next start has another epoch: these numbers are never given again
    say(turn_.payload());
    turn_.clear();
    news_ = 0;
    return;
  }
  const std::uint64_t before = store_.bytes_written() - store_.bytes_carried();
  const auto ends = turn_.ends();
  const std::span<const std::byte> payload = turn_.payload();
  if (!store_.append(turn_, config_.keep)) return refused(now);
  if (!good_) log_info("the journal can be written again");
  good_ = true;
  safe_ends_ = ends;
  budget_.wrote(static_cast<std::size_t>(store_.bytes_written() - store_.bytes_carried() - before));
  {
    const std::scoped_lock lock{mutex_};
    status_.record_bytes += std::exchange(news_, 0);
    ++status_.flushes;
    status_.flushed = acknowledged();
  }
  say(payload);  // the turn is empty, its bytes are still there
}

// A turn's own records go on the air.
void JournalWriter::say(std::span<const std::byte> payload) noexcept {
  if (radio_ == nullptr) return;
  Air air{*radio_, self_, stop_};
  (void)journal::read_items(payload, self_, air);
}

bool JournalWriter::drain(Duration patience) noexcept {
  if (!thread_.joinable()) return true;
  hurry_ = true;
  const Instant end = clock_.now() + patience;
  bool done = false;
  // Twice: a round that found nothing may have begun before the last thing was put.
  for (int round = 0; round < 2; ++round) {
    idle_ = false;
    while (!(done = idle_) && clock_.now() < end) std::this_thread::sleep_for(kNap / 4);
  }
  hurry_ = false;
  return done;
}

void JournalWriter::wait_for_room() const noexcept {
  while (!given_up_ && queue_.write_available() < capacity_ / 2) std::this_thread::sleep_for(1ms);
}

}  // namespace maplet::daemon
