// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#pragma once

#include <cstdint>
#include <functional>
#include <string>
#include <vector>

namespace CLI {
class App;
class Option;
}  // namespace CLI

namespace maplet::ctl {

/// An argument of a command. The calls chain; what a call asks for is checked before the command
/// runs, and a wrong value ends in exit code 2 with a line that says what would be right.
class Argument {
 public:
  /// @param most  of whole numbers; 0: others are wanted
  explicit Argument(CLI::Option* option, double most = 0.0) : option_{option}, most_{most} {}

  Argument& required();
  /// What --help calls the value: FILE, DIR, KEY=VALUE.
  Argument& type_name(const std::string& name);
  /// --help shows the value that stands in the variable now.
  Argument& show_default();
  Argument& range(int min, int max);
  Argument& range(double min, double max);
  Argument& positive();
  Argument& non_negative();
  Argument& one_of(const std::vector<std::string>& values);
  /// A list in one word, values apart by commas; count 0: any number.
  Argument& comma_list(int count = 0);
  /// One value each time it is named, so that a positional may follow.
  Argument& one_each();
  Argument& excludes(const Argument& other);

 private:
  CLI::Option* option_;
  double most_;
};

/// A command of the command line, or the command line itself. Only command_line.cpp knows the
/// parser behind it: its header in every command's file would be a third of a build from nothing.
/// The variables must outlive the parse: commands keep theirs in a shared_ptr that run() holds.
class Command {
 public:
  explicit Command(CLI::App* app) : app_{app} {}

  [[nodiscard]] Command add_command(const std::string& name, const std::string& help) const;
  /// A command that only groups: one of its own commands must follow.
  void require_command() const;

  Argument add_option(const std::string& name, int& value, const std::string& help) const;
  Argument add_option(const std::string& name, std::uint64_t& value, const std::string& help) const;
  Argument add_option(const std::string& name, double& value, const std::string& help) const;
  Argument add_option(const std::string& name, std::string& value, const std::string& help) const;
  Argument add_option(const std::string& name, std::vector<double>& value,
                      const std::string& help) const;
  Argument add_option(const std::string& name, std::vector<std::string>& value,
                      const std::string& help) const;
  Argument add_flag(const std::string& name, bool& value, const std::string& help) const;
  /// Under the options in --help.
  void footer(const std::string& text) const;
  void run(std::function<void()> what) const;

 private:
  CLI::App* app_;
};

/// Parses and runs the command that is named. @return the exit code; what commands throw goes on.
[[nodiscard]] int run_command_line(int argc, char** argv, const std::string& about,
                                   const std::function<void(Command)>& add_commands);

}  // namespace maplet::ctl
