// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <string>

#include "drivers/source.hpp"

namespace maplet {

/// A camera or a recording through the OpenNI2 runtime.
///
/// `where` is empty for the first camera, the URI of a camera, or a file (it ends in .oni, or it is
/// there). A recording is played frame by frame: every frame comes, in order, however long the
/// caller takes; a camera's frames that come too fast are dropped and counted. Mirrored images
/// are turned back. Stamps are the device's or the recording's.
///
/// The camera model is the configuration's when it has one (of the same size), else it follows from
/// the nominal field of view. Gray comes from a colour stream of the same size: a camera's where it
/// can register depth to colour, a recording's where the configuration says registered_to_colour.
///
/// Memory   a copy of each image, decided here; the runtime has its own: a few frames, and two
///          small blocks a frame (docs/memory.md).
/// Threads  the runtime adds two a stream. Opening changes the working directory for a moment.
[[nodiscard]] OpenedSource open_openni2(const std::string& where, const SourceOptions& options);

/// A camera whose frames OpenNI2's recorder writes into a file too, all of them, also those that
/// the caller is too slow for; the file is whole once the source is gone.
[[nodiscard]] OpenedSource record_openni2(const std::string& where, const std::string& file,
                                          const SourceOptions& options);

}  // namespace maplet
