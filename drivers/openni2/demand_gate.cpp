// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "drivers/openni2/demand_gate.hpp"

#include <algorithm>
#include <new>

namespace maplet::openni2 {

namespace {

constexpr std::align_val_t kAlign{64};

std::byte* take(std::size_t bytes) { return static_cast<std::byte*>(operator new(bytes, kAlign)); }

}  // namespace

void DemandGate::AlignedDelete::operator()(std::byte* memory) const noexcept {
  operator delete(memory, kAlign);
}

DemandGate::DemandGate(std::size_t frame_bytes, std::size_t buffers)
    : frame_bytes_{frame_bytes}, buffers_(buffers), used_(buffers) {
  for (Buffer& buffer : buffers_) buffer.reset(take(frame_bytes));
}

void DemandGate::demand() noexcept {
  const std::lock_guard lock{mutex_};
  ++wanted_;
  changed_.notify_all();
}

void DemandGate::open() noexcept {
  const std::lock_guard lock{mutex_};
  open_ = true;
  changed_.notify_all();
}

bool DemandGate::waiting() const noexcept {
  const std::lock_guard lock{mutex_};
  return waiting_ > 0 && wanted_ == 0;
}

void* DemandGate::allocateFrameBuffer(int size) {
  std::unique_lock lock{mutex_};
  ++waiting_;
  changed_.wait(lock, [this] { return open_ || wanted_ > 0; });
  --waiting_;
  wanted_ = std::max(0, wanted_ - 1);
  if (static_cast<std::size_t>(size) <= frame_bytes_) {
    for (std::size_t i = 0; i < buffers_.size(); ++i) {
      if (used_[i]) continue;
      used_[i] = true;
      return buffers_[i].get();
    }
  }
  return take(static_cast<std::size_t>(size));
}

void DemandGate::freeFrameBuffer(void* data) {
  const std::lock_guard lock{mutex_};
  for (std::size_t i = 0; i < buffers_.size(); ++i) {
    if (buffers_[i].get() != data) continue;
    used_[i] = false;
    return;
  }
  operator delete(data, kAlign);
}

}  // namespace maplet::openni2
