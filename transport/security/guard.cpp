// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "transport/security/guard.hpp"

#include <algorithm>
#include <numeric>

#include "transport/exchange/byte_io.hpp"

namespace maplet {

namespace {

constexpr Duration kForgotten = std::chrono::seconds{60};  // silent for longer: asked soon again
constexpr Duration kBetweenVerifications = std::chrono::milliseconds{50};

std::uint64_t draw() noexcept {
  std::array<std::byte, 8> bytes{};
  fill_random(bytes);
  return ByteReader{bytes}.fixed(8);
}

}  // namespace

std::string_view to_string(Refusal refusal) noexcept {
  static constexpr std::string_view kNames[kRefusals] = {
      "plain",   "foreign", "tampered",  "replayed", "unproven",
      "old_key", "revoked", "newer_key", "no_keys",  "notice"};
  return kNames[static_cast<std::size_t>(refusal)];
}

std::uint64_t GuardCounters::all_refused() const noexcept {
  return std::accumulate(refused.begin(), refused.end(), std::uint64_t{0});
}

Guard::Guard(const Config& config, const AgentKeys& keys, Arena& arena)
    : config_{config},
      keys_{keys},
      sessions_{config.sessions, arena},
      board_{5 * config.quick, arena},
      now_s_{keys.validity.not_before_s},
      random_{draw() | 1U} {
  take_key();
  start_session();
}

void Guard::take_key() noexcept {
  std::array<std::byte, 12> salt{};
  ByteWriter out{salt};
  out.bytes(team_of(keys_.operator_key));
  out.fixed(keys_.generation, 4);
  Aead::Key key;
  derive(key.bytes(), keys_.group.bytes(), salt, "mapletd frames, AES-CCM-16-64-128");
  aead_.set_key(key);
}

void Guard::start_session() noexcept {
  session_ = draw();
  counter_ = 0;
}

Duration Guard::jitter(Duration most) noexcept {
  random_ ^= random_ << 13;
  random_ ^= random_ >> 7;
  random_ ^= random_ << 17;
  return Duration{static_cast<Duration::rep>(
      random_ % static_cast<std::uint64_t>(std::max<Duration::rep>(most.count(), 1)))};
}

bool Guard::is_revoked(std::uint16_t agent) const noexcept {
  return std::ranges::find(keys_.revoked, agent) != keys_.revoked.end();
}

Guard::State Guard::state() const noexcept {
  if (is_revoked(keys_.agent)) return State::kRevoked;
  switch (keys_.validity.at(now_s_, config_.clock_tolerance_s)) {
    case Validity::State::kNotYet:
      return State::kNotYet;
    case Validity::State::kExpired:
      return State::kExpired;
    default:
      return State::kGood;
  }
}

void Guard::refuse(Refusal why, int agent) noexcept {
  ++counters_.refused[static_cast<std::size_t>(why)];
  counters_.last_agent = agent;
}

std::span<const std::byte> Guard::seal(std::span<const std::byte> datagram) noexcept {
  if (state() != State::kGood) return {};
  ++counters_.sealed;
  return seal_text(FrameKind::kSealed, text_of(datagram));
}

std::span<const std::byte> Guard::seal_text(FrameKind kind,
                                            std::span<const std::byte> text) noexcept {
  const std::size_t size = kFrameHeadBytes + text.size() + Aead::kTagBytes;
  if (text.empty() || size > out_.size()) return {};
  if (counter_ >= config_.last_counter) start_session();  // the others ask it for a proof
  const FrameHead head{kind, static_cast<std::uint8_t>(keys_.generation), keys_.agent, session_,
                       ++counter_};
  const std::span out{out_};
  write(out.first<kFrameHeadBytes>(), head);
  aead_.seal(head.nonce(), out.first(kFrameHeadBytes), text,
             out.subspan(kFrameHeadBytes, text.size() + Aead::kTagBytes));
  return out.first(size);
}

std::span<const std::byte> Guard::open(std::span<const std::byte> frame, Instant now) noexcept {
  if (!frame.empty() && frame[0] == static_cast<std::byte>(FrameKind::kNotice)) {
    hear_notice(frame, now);
    return {};
  }
  const auto head = read_frame_head(frame);
  if (!head || frame.size() > in_.size()) {
    const DatagramReader plain{frame};
    const bool is_plain = plain.fault() == DatagramFault::kNone;
    refuse(is_plain ? Refusal::kPlain : Refusal::kTampered,
           is_plain ? plain.head().sender.agent : -1);
    return {};
  }
  return current(*head, now) ? open_sealed(frame, *head, now) : std::span<const std::byte>{};
}

/// Whether the frame says that it has our key's generation. It may lie: then it does not open.
bool Guard::current(const FrameHead& head, Instant now) noexcept {
  if (state() != State::kGood) {
    refuse(Refusal::kNoKeys, head.agent);
    return false;
  }
  const auto ahead = static_cast<std::int8_t>(
      static_cast<std::uint8_t>(head.generation - static_cast<std::uint8_t>(keys_.generation)));
  if (ahead < 0) {
    refuse(is_revoked(head.agent) ? Refusal::kRevoked : Refusal::kOldKey, head.agent);
    board_.wanted(head.agent, now);
  } else if (ahead > 0) {
    refuse(Refusal::kNewerKey, head.agent);
  } else if (is_revoked(head.agent)) {
    refuse(Refusal::kRevoked, head.agent);
  } else if (head.agent == keys_.agent && head.session == session_) {
    refuse(Refusal::kReplayed, head.agent);
  } else {
    return true;
  }
  return false;
}

std::span<const std::byte> Guard::open_sealed(std::span<const std::byte> frame,
                                              const FrameHead& head, Instant now) noexcept {
  Session* session = sessions_.find(head.agent, head.session);
  const bool known = session != nullptr;
  if (known && session->state == Session::State::kProven && !session->window.fresh(head.counter)) {
    refuse(Refusal::kReplayed, head.agent);
    return {};
  }
  const std::size_t text_bytes = frame.size() - kFrameHeadBytes - Aead::kTagBytes;
  const std::span text = std::span{in_}.subspan(kTextAt, text_bytes);
  if (kTextAt + text_bytes + kDatagramCrcBytes > in_.size() ||
      !aead_.open(head.nonce(), frame.first(kFrameHeadBytes), frame.subspan(kFrameHeadBytes),
                  text)) {
    refuse(known ? Refusal::kTampered : Refusal::kForeign, head.agent);
    return {};
  }
  if (!known) session = &sessions_.add(head.agent, head.session, now);
  if (now - session->heard > kForgotten) session->patience = {};
  session->heard = now;
  if (session->state == Session::State::kEnded) {
    refuse(Refusal::kReplayed, head.agent);
    return {};
  }
  if (session->state == Session::State::kProven) session->window.note(head.counter);
  if (head.kind == FrameKind::kTalk) {
    hear_talk(text, head, *session, now);
    return {};
  }
  if (session->state == Session::State::kUnproven) {
    refuse(Refusal::kUnproven, head.agent);
    ++session->waiting;
    ask(*session, now);
    return {};
  }
  ++counters_.opened;
  return datagram_of(in_, text_bytes, head.agent);
}

void Guard::hear_notice(std::span<const std::byte> bytes, Instant now) noexcept {
  const auto notice = read_key_notice(bytes);
  const bool ours = notice && notice->team == team_of(keys_.operator_key);
  if (ours && notice->generation < newest_generation()) {
    refuse(Refusal::kOldKey, -1);
    board_.wanted(keys_.agent, now);  // whoever said it knows no better
    return;
  }
  if (ours && board_.holds(notice->generation, notice->part)) return;
  // Signatures take time: a flood of forged ones does not take all of it.
  const bool may = now - verified_at_ >= kBetweenVerifications;
  if (ours && may) verified_at_ = now;
  if (!ours || !may || take_notice(bytes, now) == Taken::kForged) refuse(Refusal::kNotice, -1);
}

Guard::Taken Guard::take_notice(std::span<const std::byte> bytes, Instant now) noexcept {
  const auto notice = read_key_notice(bytes);
  if (!notice) return Taken::kNoSense;
  if (notice->team != team_of(keys_.operator_key)) return Taken::kForeign;
  if (!signed_by(keys_.operator_key, bytes)) return Taken::kForged;
  if (notice->generation < newest_generation()) return Taken::kOld;
  if (board_.holds(notice->generation, notice->part)) return Taken::kKnown;
  (void)board_.put(*notice, bytes, now);
  if (follow(keys_, *notice)) take_key();
  for (const std::uint16_t agent : keys_.revoked) sessions_.end_all_of(agent);
  return Taken::kNew;
}

std::span<const std::byte> Guard::next(Instant now) noexcept {
  if (const auto notice = board_.next(now); !notice.empty()) return notice;
  return state() == State::kGood ? write_talk(now) : std::span<const std::byte>{};
}

}  // namespace maplet
