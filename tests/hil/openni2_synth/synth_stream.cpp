// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "tests/hil/openni2_synth/synth_stream.hpp"

#include <algorithm>

namespace maplet::synth {

namespace {

constexpr int kMaxDepthMm = 10000;

}  // namespace

int SynthStream::stride_bytes() const {
  return mode_.resolutionX * (type_ == ONI_SENSOR_DEPTH ? 2 : 3);
}

OniStatus SynthStream::getProperty(int id, void* data, int* size) {
  switch (id) {
    case ONI_STREAM_PROPERTY_VIDEO_MODE:
      return answer(mode_, data, size);
    case ONI_STREAM_PROPERTY_HORIZONTAL_FOV:
      return answer(optics_.horizontal_fov_rad, data, size);
    case ONI_STREAM_PROPERTY_VERTICAL_FOV:
      return answer(optics_.vertical_fov_rad, data, size);
    case ONI_STREAM_PROPERTY_MIRRORING:
      return answer(mirror_, data, size);
    case ONI_STREAM_PROPERTY_STRIDE:
      return answer(stride_bytes(), data, size);
    case ONI_STREAM_PROPERTY_CROPPING:  // unanswered, a recording of this plays no frames
      return answer(OniCropping{FALSE, 0, 0, mode_.resolutionX, mode_.resolutionY}, data, size);
    case ONI_STREAM_PROPERTY_MAX_VALUE:
      return answer(type_ == ONI_SENSOR_DEPTH ? kMaxDepthMm : 255, data, size);
    case ONI_STREAM_PROPERTY_MIN_VALUE:
      return answer(0, data, size);
    default:
      return ONI_STATUS_NOT_SUPPORTED;
  }
}

OniStatus SynthStream::setProperty(int id, const void* data, int size) {
  if (id == ONI_STREAM_PROPERTY_VIDEO_MODE) {
    return accept(mode_, data, size) ? ONI_STATUS_OK : ONI_STATUS_BAD_PARAMETER;
  }
  if (id == ONI_STREAM_PROPERTY_MIRRORING && !stuck_mirror_) {
    return accept(mirror_, data, size) ? ONI_STATUS_OK : ONI_STATUS_BAD_PARAMETER;
  }
  return ONI_STATUS_NOT_SUPPORTED;
}

OniBool SynthStream::isPropertySupported(int id) {
  return id >= ONI_STREAM_PROPERTY_CROPPING && id <= ONI_STREAM_PROPERTY_MIRRORING;
}

void SynthStream::notifyAllProperties() {
  raisePropertyChanged(ONI_STREAM_PROPERTY_VIDEO_MODE, &mode_, sizeof mode_);
  raisePropertyChanged(ONI_STREAM_PROPERTY_HORIZONTAL_FOV, &optics_.horizontal_fov_rad,
                       sizeof optics_.horizontal_fov_rad);
  raisePropertyChanged(ONI_STREAM_PROPERTY_VERTICAL_FOV, &optics_.vertical_fov_rad,
                       sizeof optics_.vertical_fov_rad);
  raisePropertyChanged(ONI_STREAM_PROPERTY_MIRRORING, &mirror_, sizeof mirror_);
}

void SynthStream::fill(OniFrame& out, const DepthFrame& frame) const {
  const int width = frame.depth.width_px;
  for (int v = 0; v < frame.depth.height_px; ++v) {
    auto* row = static_cast<std::uint8_t*>(out.data) + v * out.stride;
    for (int u = 0; u < width; ++u) {
      const int from = mirror_ ? width - 1 - u : u;
      if (type_ == ONI_SENSOR_DEPTH) {
        const std::uint16_t depth = frame.depth.at(from, v);
        std::memcpy(row + 2 * u, &depth, sizeof depth);
      } else {
        std::memset(row + 3 * u, frame.gray.at(from, v), 3);
      }
    }
  }
}

void SynthStream::push(const DepthFrame& frame, int index, std::uint64_t stamp_us, Damage damage) {
  if (!started_) return;
  OniFrame* out = getServices().acquireFrame();
  if (out == nullptr) return;
  out->frameIndex = index;
  out->timestamp = stamp_us;
  out->sensorType = type_;
  out->videoMode = mode_;
  out->width = mode_.resolutionX;
  out->height = mode_.resolutionY;
  out->stride = stride_bytes();
  out->dataSize = out->stride * out->height;
  out->croppingEnabled = FALSE;
  out->cropOriginX = out->cropOriginY = 0;
  fill(*out, frame);
  if (damage == Damage::kShort) out->dataSize /= 3;
  if (damage == Damage::kHalfSize) {
    out->width = out->videoMode.resolutionX /= 2;
    out->height = out->videoMode.resolutionY /= 2;
    out->stride /= 2;
    out->dataSize /= 4;
  }
  raiseNewFrame(out);
  getServices().releaseFrame(out);
}

}  // namespace maplet::synth
