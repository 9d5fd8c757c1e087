// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "daemon/control_server.hpp"

#include <fmt/format.h>
#include <poll.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/un.h>
#include <unistd.h>

#include <cerrno>
#include <chrono>
#include <cstring>

#include "daemon/control_path.hpp"
#include "daemon/thread_setup.hpp"

namespace maplet::daemon {

namespace {

std::int64_t now_ms() {
  using namespace std::chrono;
  return duration_cast<milliseconds>(steady_clock::now().time_since_epoch()).count();
}

tl::expected<sockaddr_un, std::string> address_of(const std::string& path) {
  sockaddr_un address{};
  address.sun_family = AF_UNIX;
  if (path.size() >= sizeof address.sun_path) {
    return tl::unexpected{path + ": too long for a socket; choose a shorter control.socket"};
  }
  std::memcpy(address.sun_path, path.c_str(), path.size());
  return address;
}

/// Whether somebody answers at that address, or is too busy to.
bool is_alive(const sockaddr_un& address) {
  const int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  if (fd < 0) return false;
  const bool alive =
      connect(fd, reinterpret_cast<const sockaddr*>(&address), sizeof address) == 0 ||
      errno == EAGAIN;
  close(fd);
  return alive;
}

/// What stands there and is no socket: nothing that we may remove.
bool is_taken(const std::string& path) {
  struct stat there {};
  return lstat(path.c_str(), &there) == 0 && !S_ISSOCK(there.st_mode);
}

tl::expected<int, std::string> listen_at(const std::string& path) {
  const auto address = address_of(path);
  if (!address) return tl::unexpected{address.error()};
  if (is_alive(*address)) {
    return tl::unexpected{path +
                          ": another mapletd answers there; give --agent or control.socket of "
                          "its own"};
  }
  if (is_taken(path)) {
    return tl::unexpected{path + ": is there, and no socket; set control.socket to another path"};
  }
  unlink(path.c_str());
  const int fd = socket(AF_UNIX, SOCK_STREAM | SOCK_CLOEXEC | SOCK_NONBLOCK, 0);
  const mode_t before = umask(0117);  // owner and group
  const bool bound =
      fd >= 0 && bind(fd, reinterpret_cast<const sockaddr*>(&*address), sizeof *address) == 0;
  umask(before);
  if (bound && listen(fd, 64) == 0) return fd;
  const std::string why = std::strerror(errno);
  if (fd >= 0) close(fd);
  return tl::unexpected{fmt::format(
      "{}: no control socket ({}); set control.socket to a path you may write", path, why)};
}

std::string first_writable(int agent) {
  std::string path;
  for (const std::string& folder : control_folders()) {
    path = folder + "/" + control_socket_name(agent);
    if (mkdir(folder.c_str(), 0750) != 0 && errno != EEXIST) continue;
    if (access(folder.c_str(), W_OK) == 0) break;
  }
  return path;
}

}  // namespace

tl::expected<std::unique_ptr<ControlServer>, std::string> ControlServer::start(
    const std::string& path, int agent, Answer answer) {
  const std::string place = path.empty() ? first_writable(agent) : path;
  const auto fd = listen_at(place);
  if (!fd) return tl::unexpected{fd.error()};
  return std::unique_ptr<ControlServer>{new ControlServer{*fd, place, std::move(answer)}};
}

ControlServer::ControlServer(int fd, std::string path, Answer answer)
    : fd_{fd}, path_{std::move(path)}, answer_{std::move(answer)} {
  thread_ = start_thread("control", [this] { loop(); });
}

ControlServer::~ControlServer() {
  stop_ = true;
  thread_.join();
  for (const Client& client : clients_) close(client.fd);
  close(fd_);
  unlink(path_.c_str());
}

void ControlServer::loop() {
  std::vector<pollfd> polled;
  while (!stop_) {
    polled.assign(1, {fd_, POLLIN, 0});
    for (const Client& client : clients_) {
      const int events = client.answered ? POLLOUT : POLLIN;
      polled.push_back({client.fd, static_cast<short>(events), 0});
    }
    if (poll(polled.data(), polled.size(), 100) < 0) continue;
    for (std::size_t i = clients_.size(); i-- > 0;) {
      const bool ready = polled[i + 1].revents != 0;
      if ((!ready || serve(clients_[i])) && now_ms() < clients_[i].until_ms) continue;
      close(clients_[i].fd);
      clients_.erase(clients_.begin() + static_cast<std::ptrdiff_t>(i));
    }
    if ((polled[0].revents & POLLIN) != 0 && clients_.size() < kMaxClients) accept_one();
  }
}

void ControlServer::accept_one() {
  const int fd = accept4(fd_, nullptr, nullptr, SOCK_CLOEXEC | SOCK_NONBLOCK);
  if (fd >= 0) clients_.push_back({fd, {}, {}, false, now_ms() + kPatience_ms});
}

bool ControlServer::serve(Client& client) {
  if (client.answered) {
    const ssize_t sent = send(client.fd, client.out.data(), client.out.size(), MSG_NOSIGNAL);
    if (sent < 0) return errno == EAGAIN;
    client.out.erase(0, static_cast<std::size_t>(sent));
    return !client.out.empty();
  }
  char buffer[4096];
  const ssize_t got = recv(client.fd, buffer, sizeof buffer, 0);
  if (got < 0) return errno == EAGAIN;
  if (got == 0) return false;
  client.in.append(buffer, static_cast<std::size_t>(got));
  if (client.in.size() > kMaxLineBytes) return false;
  const std::size_t end = client.in.find('\n');
  if (end == std::string::npos) return true;
  client.out = answer_(client.in.substr(0, end)) + "\n";
  client.answered = true;
  client.until_ms = now_ms() + kPatience_ms;
  return true;
}

}  // namespace maplet::daemon
