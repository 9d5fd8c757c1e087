// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <span>
#include <string>
#include <tl/expected.hpp>
#include <vector>

#include "transport/security/agent_keys.hpp"

namespace maplet {

// Keys and notices on disk, in PEM armour. Errors are one line: what, where, remedy.

inline constexpr const char* kAgentKeysFile = "agent.keys";
inline constexpr const char* kNoticeFile = "newest.notice";

using Bytes = std::vector<std::byte>;

/// A file that is nobody else's business: regular, of the caller or root, closed to group and
/// others. @return why it is not to be used
[[nodiscard]] tl::expected<std::string, std::string> read_private(const std::string& path);
/// A file that anybody may read. @return why it cannot be read
[[nodiscard]] tl::expected<std::string, std::string> read_public(const std::string& path);
/// Writes beside it and renames: whole or not at all, and on disk when it returns.
/// @param mode  0600 for what is secret
[[nodiscard]] std::string write_file(const std::string& path, std::string_view text, int mode);

/// A user's name for a person to read.
[[nodiscard]] std::string user_name(unsigned uid);

/// The keys in DIR/agent.keys.
[[nodiscard]] tl::expected<AgentKeys, std::string> load_agent_keys(const std::string& dir);
[[nodiscard]] std::string agent_keys_text(const AgentKeys& keys, const SigningKey& signer);

/// Every notice in a text, in the order they stand there; what else is there is passed over.
[[nodiscard]] std::vector<Bytes> notices_in(const std::string& text);
/// How many notices begin in a text: more than notices_in() finds where some are damaged.
[[nodiscard]] std::size_t notices_begun(const std::string& text);
[[nodiscard]] std::string notice_text(std::span<const std::byte> notice);

}  // namespace maplet
