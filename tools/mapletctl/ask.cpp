// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "tools/mapletctl/ask.hpp"

#include <fmt/core.h>
#include <sys/socket.h>
#include <sys/un.h>
#include <unistd.h>

#include <algorithm>
#include <cerrno>
#include <cstring>
#include <filesystem>

#include "daemon/control_path.hpp"

namespace maplet::ctl {

namespace {

constexpr int kPatience_s = 6;

/// Whether nobody listens there any more: a daemon that was killed leaves its socket.
bool is_stale(const std::string& path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  if (path.size() >= sizeof address.sun_path) return false;
  std::memcpy(address.sun_path, path.c_str(), path.size());
  const int fd = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  const bool stale =
      connect(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0 &&
      errno == ECONNREFUSED;
  ::close(fd);
  return stale;
}

std::string find_socket(const Daemon& daemon) {
  namespace fs = std::filesystem;
  if (!daemon.socket.empty()) return daemon.socket;
  std::vector<std::string> found;
  for (const std::string& folder : daemon::control_folders()) {
    std::error_code error;
    for (const auto& entry : fs::directory_iterator{folder, error}) {
      const std::string name = entry.path().filename();
      const bool fits = daemon.agent < 0 ? name.starts_with("agent-") && name.ends_with(".sock")
                                         : name == daemon::control_socket_name(daemon.agent);
      if (fits) found.push_back(entry.path());
    }
  }
  if (found.empty()) {
    throw Failure{"no mapletd found: start one, or name its socket with --socket"};
  }
  const auto stale = std::stable_partition(found.begin(), found.end(),
                                           [](const auto& path) { return !is_stale(path); });
  if (stale != found.begin()) found.erase(stale, found.end());
  if (found.size() > 1 && daemon.agent < 0) {
    throw Failure{fmt::format("{} daemons run here: say which with --agent N", found.size()), 2};
  }
  return found.front();
}

class Connection {
 public:
  explicit Connection(const std::string& path) : path_{path} {
    sockaddr_un address{};
    address.sun_family = AF_UNIX;
    if (path.size() >= sizeof address.sun_path) throw Failure{path + ": too long for a socket"};
    std::memcpy(address.sun_path, path.c_str(), path.size());
    fd_ = ::socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC, 0);
    const timeval limit{kPatience_s, 0};
    setsockopt(fd_, SOL_SOCKET, SO_RCVTIMEO, &limit, sizeof limit);
    setsockopt(fd_, SOL_SOCKET, SO_SNDTIMEO, &limit, sizeof limit);
    if (connect(fd_, reinterpret_cast<const sockaddr*>(&address), sizeof address) != 0) {
      const std::string why = std::strerror(errno);
      ::close(fd_);
      throw Failure{
          fmt::format("{}: no mapletd answers ({}); is it running, may you use its "
                      "socket?",
                      path, why)};
    }
  }
  ~Connection() { ::close(fd_); }
  Connection(const Connection&) = delete;
  Connection& operator=(const Connection&) = delete;

  std::string ask(const std::string& line) {
    if (send(fd_, line.data(), line.size(), MSG_NOSIGNAL) != static_cast<ssize_t>(line.size())) {
      throw Failure{path_ + ": mapletd does not listen"};
    }
    std::string answer;
    char buffer[4096];
    for (ssize_t got = 0; (got = recv(fd_, buffer, sizeof buffer, 0)) > 0;) {
      answer.append(buffer, static_cast<std::size_t>(got));
    }
    if (answer.empty()) throw Failure{path_ + ": mapletd did not answer in time"};
    return answer;
  }

 private:
  std::string path_;
  int fd_ = -1;
};

}  // namespace

void add_daemon_options(Command command, const std::shared_ptr<Daemon>& daemon) {
  command.add_option("--agent", daemon->agent, "which daemon of this host, by its agent number")
      .range(0, 65535);
  command.add_option("--socket", daemon->socket, "its Unix socket (control.socket)");
}

nlohmann::ordered_json ask(const Daemon& daemon, const nlohmann::ordered_json& question) {
  const std::string path = find_socket(daemon);
  using Json = nlohmann::ordered_json;
  const std::string line = question.dump(-1, ' ', false, Json::error_handler_t::replace) + "\n";
  const auto answer = nlohmann::ordered_json::parse(Connection{path}.ask(line), nullptr, false);
  if (answer.is_discarded()) throw Failure{path + ": the answer makes no sense"};
  if (answer.is_object() && answer.contains("error")) {
    throw Failure{answer["error"].get<std::string>()};
  }
  return answer;
}

}  // namespace maplet::ctl
