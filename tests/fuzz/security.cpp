// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include <algorithm>
#include <memory>
#include <vector>

#include "tests/fuzz/fuzz.hpp"
#include "transport/security/guard.hpp"
#include "transport/security/key_files.hpp"

namespace {

using namespace maplet;

constexpr std::int64_t kNow = 1'800'000'000;

template <std::size_t N>
Secret<N> secret(std::uint8_t first) {
  Secret<N> made;
  std::ranges::fill(made.bytes(), static_cast<std::byte>(first));
  return made;
}

const SigningKey& operator_key() {
  static const SigningKey key = secret<32>(1);
  return key;
}

AgentKeys keys_of(std::uint16_t agent) {
  AgentKeys keys;
  keys.operator_key = verifying_key(operator_key());
  keys.agent = agent;
  keys.generation = 3;
  keys.validity = {kNow - 1000, kNow + 1000};
  keys.own = secret<32>(static_cast<std::uint8_t>(agent));
  keys.group = secret<16>(9);
  return keys;
}

/// Somebody with the group's key who says anything at all.
class Insider {
 public:
  Insider() {
    std::array<std::byte, 12> salt{};
    ByteWriter out{salt};
    const AgentKeys keys = keys_of(2);
    out.bytes(team_of(keys.operator_key));
    out.fixed(keys.generation, 4);
    Aead::Key key;
    derive(key.bytes(), keys.group.bytes(), salt, "mapletd frames, AES-CCM-16-64-128");
    aead_.set_key(key);
  }
  std::vector<std::byte> seal(FrameKind kind, std::span<const std::byte> text) {
    std::vector<std::byte> frame(kFrameHeadBytes + text.size() + Aead::kTagBytes);
    const FrameHead head{kind, 3, 2, 77, ++counter_};
    const std::span out{frame};
    write(out.first<kFrameHeadBytes>(), head);
    aead_.seal(head.nonce(), out.first(kFrameHeadBytes), text, out.subspan(kFrameHeadBytes));
    return frame;
  }

 private:
  Aead aead_;
  std::uint32_t counter_ = 0;
};

std::vector<std::byte> signed_again(std::span<const std::byte> bytes) {
  std::vector<std::byte> out{bytes.begin(), bytes.end()};
  const Signature signature = sign(operator_key(), bytes);
  out.insert(out.end(), signature.begin(), signature.end());
  return out;
}

}  // namespace

// Frames from anybody, one after the other: what kind (an octet), a length (two), so many bytes. As
// they are; sealed by an insider, as a datagram or as talk; signed, as a notice or as an agent's
// keys; as a file.
int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  Arena arena{std::size_t{1} << 20};
  const auto guard = std::make_unique<Guard>(Guard::Config{300, std::chrono::milliseconds{800}, 4},
                                             keys_of(1), arena);
  guard->set_wall_clock(kNow);
  Insider insider;
  Instant now{std::chrono::hours{1}};
  for (std::size_t at = 0; at + 3 <= size; now += std::chrono::milliseconds{300}) {
    const int kind = data[at] % 6;
    const std::size_t length =
        std::min<std::size_t>(data[at + 1] | std::size_t{data[at + 2]} << 8, size - at - 3);
    const auto bytes = fuzz::bytes(data + at + 3, length);
    at += 3 + length;
    std::vector<std::byte> frame{bytes.begin(), bytes.end()};
    if ((kind == 1 || kind == 2) && length > 0) {
      frame = insider.seal(kind == 1 ? FrameKind::kSealed : FrameKind::kTalk, bytes);
    }
    if (kind == 3) frame = signed_again(bytes);
    if (kind == 4) {
      const auto keys = read_agent_keys(signed_again(bytes));
      if (!keys) fuzz::require_one_line(keys.error());
      (void)read_agent_keys(bytes);
    }
    if (kind == 5) (void)notices_in({reinterpret_cast<const char*>(bytes.data()), bytes.size()});
    const std::uint64_t refused = guard->counters().all_refused();
    const auto inside = guard->open(frame, now);
    const bool notice = !frame.empty() && frame[0] == static_cast<std::byte>(FrameKind::kNotice);
    if (kind == 0 && !notice) {
      fuzz::require(guard->counters().all_refused() == refused + 1, "refusals are counted");
    }
    if (!inside.empty()) {
      fuzz::require(kind == 1, "only what a member sealed is let in");
      fuzz::require(DatagramReader{inside}.fault() == DatagramFault::kNone, "as a datagram");
    }
    for (int i = 0; i < 4; ++i) {
      fuzz::require(guard->next(now).size() <= kMaxDatagramBytes, "what is said fits");
    }
  }
  return 0;
}
