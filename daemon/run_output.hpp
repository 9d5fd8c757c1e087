// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <array>
#include <cstdint>
#include <filesystem>
#include <memory>
#include <string>
#include <string_view>
#include <tl/expected.hpp>

#include "core/agent/agent.hpp"
#include "daemon/frame_digest.hpp"
#include "daemon/output_file.hpp"

namespace maplet::daemon {

/// The folder of a finite run (docs/output.md), written while the run goes on.
///
/// Memory   fixed while running; finish() allocates.
/// Errors   the first one is kept; the run goes on and finish() says it.
class RunOutput {
 public:
  /// Makes the folder and removes what an earlier run left there of these files.
  [[nodiscard]] static tl::expected<std::unique_ptr<RunOutput>, std::string> create(
      const std::string& folder);
  ~RunOutput();
  RunOutput(const RunOutput&) = delete;
  RunOutput& operator=(const RunOutput&) = delete;

  /// @param index  of the source
  void frame(std::uint64_t index, const Step& step, const FrameDigest& digest) noexcept;
  void maplet(const MapletCut& closed) noexcept;
  void delta_pose(std::string_view json_line) noexcept;

  /// Writes what needs the whole run: trajectory.tum and skeleton.g2o.
  [[nodiscard]] tl::expected<void, std::string> finish(const Agent& agent);

  [[nodiscard]] const std::filesystem::path& folder() const noexcept { return folder_; }

 private:
  explicit RunOutput(std::filesystem::path folder) : folder_{std::move(folder)} {}
  /// For this object's life. @return false: another run has it
  [[nodiscard]] bool lock() noexcept;
  void note(const OutputFile& file) noexcept;

  std::filesystem::path folder_;
  int lock_ = -1;  ///< the open folder
  OutputFile odometry_;
  OutputFile delta_poses_;
  OutputFile digests_;  // of every frame
  OutputFile frames_;   // what trajectory.tum is made from at the end
  OutputFile maplet_;
  int error_ = 0;  // errno of the first failure
};

}  // namespace maplet::daemon
