// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <atomic>
#include <functional>
#include <memory>
#include <string>
#include <thread>
#include <tl/expected.hpp>
#include <vector>

namespace maplet::daemon {

/// The daemon's Unix socket: a client writes one line, gets one line, and that is it.
///
/// Memory   at most kMaxClients with kMaxLineBytes each; answers are the answerer's.
/// Threads  one of its own, which calls `answer`. A client that is slow to write or to read is
///   dropped after kPatience and keeps nobody waiting.
class ControlServer {
 public:
  static constexpr std::size_t kMaxClients = 64;
  static constexpr std::size_t kMaxLineBytes = 16384;
  static constexpr int kPatience_ms = 5000;
  using Answer = std::function<std::string(const std::string& line)>;

  /// @param path   empty: agent-N.sock in the first folder that may be written
  /// @return the server, or one line that says why there is none
  [[nodiscard]] static tl::expected<std::unique_ptr<ControlServer>, std::string> start(
      const std::string& path, int agent, Answer answer);
  ~ControlServer();
  ControlServer(const ControlServer&) = delete;
  ControlServer& operator=(const ControlServer&) = delete;

  [[nodiscard]] const std::string& path() const noexcept { return path_; }

 private:
  struct Client {
    int fd = -1;
    std::string in;
    std::string out;
    bool answered = false;
    std::int64_t until_ms = 0;
  };

  ControlServer(int fd, std::string path, Answer answer);
  void loop();
  void accept_one();
  /// @return false when the client is done
  bool serve(Client& client);

  int fd_;
  std::string path_;
  Answer answer_;
  std::vector<Client> clients_;
  std::atomic<bool> stop_{false};
  std::thread thread_;
};

}  // namespace maplet::daemon
