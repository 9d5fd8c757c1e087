// Copyright the mapletd authors. SPDX-License-Identifier: Apache-2.0
#include "tools/mapletctl/command_line.hpp"

#include <fmt/core.h>
#include <fmt/format.h>

#include <CLI/CLI.hpp>
#include <cmath>
#include <cstdio>
#include <cstdlib>
#include <limits>

namespace maplet::ctl {

namespace {

/// A number from `least` on, or above it; CLI11's own validators name DBL_MAX as the other end.
/// @param most  of whole numbers; 0: others are wanted
CLI::Validator number(double least, bool above, double most, const std::string& name) {
  const std::string wanted = most > 0.0 ? fmt::format("a whole number from {:.0f} to {:.0f}",
                                                      above ? least + 1 : least, most)
                             : above    ? fmt::format("a number above {:g}", least)
                                        : fmt::format("{:g} or a number above", least);
  return {[=](std::string& text) {
            double value = 0.0;
            const bool holds = CLI::detail::lexical_cast(text, value) && std::isfinite(value) &&
                               (above ? value > least : value >= least) &&
                               (most == 0.0 || (value <= most && value == std::floor(value) &&
                                                text.find_first_of(".eE") == std::string::npos));
            return holds ? std::string{} : fmt::format("{} is not {}", text, wanted);
          },
          name};
}

}  // namespace

Argument& Argument::required() {
  option_->required();
  return *this;
}

Argument& Argument::type_name(const std::string& name) {
  option_->type_name(name);
  return *this;
}

Argument& Argument::show_default() {
  option_->capture_default_str();
  return *this;
}

Argument& Argument::range(int min, int max) {
  option_->check(CLI::Range(min, max));
  return *this;
}

Argument& Argument::range(double min, double max) {
  option_->check(CLI::Range(min, max));
  option_->check([=](const std::string& text) {  // nan is neither below nor above
    return std::isnan(std::strtod(text.c_str(), nullptr))
               ? fmt::format("Value {} not in range [{:g} - {:g}]", text, min, max)
               : std::string{};
  });
  return *this;
}

Argument& Argument::positive() {
  option_->check(number(0.0, true, most_, "POSITIVE"));
  return *this;
}

Argument& Argument::non_negative() {
  option_->check(number(0.0, false, most_, "NONNEGATIVE"));
  return *this;
}

Argument& Argument::one_of(const std::vector<std::string>& values) {
  option_->check(CLI::IsMember(values));
  return *this;
}

Argument& Argument::comma_list(int count) {
  option_->delimiter(',');
  if (count > 0) option_->expected(count);
  return *this;
}

Argument& Argument::one_each() {
  option_->allow_extra_args(false);
  return *this;
}

Argument& Argument::excludes(const Argument& other) {
  option_->excludes(other.option_);
  return *this;
}

Command Command::add_command(const std::string& name, const std::string& help) const {
  return Command{app_->add_subcommand(name, help)};
}

void Command::require_command() const { app_->require_subcommand(1); }

Argument Command::add_option(const std::string& name, int& value, const std::string& help) const {
  return Argument{app_->add_option(name, value, help), std::numeric_limits<int>::max()};
}

Argument Command::add_option(const std::string& name, std::uint64_t& value,
                             const std::string& help) const {
  return Argument{app_->add_option(name, value, help), 0x1p53};
}

Argument Command::add_option(const std::string& name, double& value,
                             const std::string& help) const {
  return Argument{app_->add_option(name, value, help)};
}

Argument Command::add_option(const std::string& name, std::string& value,
                             const std::string& help) const {
  return Argument{app_->add_option(name, value, help)};
}

Argument Command::add_option(const std::string& name, std::vector<double>& value,
                             const std::string& help) const {
  return Argument{app_->add_option(name, value, help)};
}

Argument Command::add_option(const std::string& name, std::vector<std::string>& value,
                             const std::string& help) const {
  return Argument{app_->add_option(name, value, help)};
}

Argument Command::add_flag(const std::string& name, bool& value, const std::string& help) const {
  return Argument{app_->add_flag(name, value, help)};
}

void Command::footer(const std::string& text) const { app_->footer(text); }

void Command::run(std::function<void()> what) const { app_->callback(std::move(what)); }

int run_command_line(int argc, char** argv, const std::string& about,
                     const std::function<void(Command)>& add_commands) {
  CLI::App app{about};
  app.get_formatter()->column_width(32);  // of the longest option, and two spaces: tools/man
  app.require_subcommand(1);
  app.set_version_flag("--version", "mapletctl " MAPLET_VERSION);
  add_commands(Command{&app});
  try {
    app.parse(argc, argv);
  } catch (const CLI::ParseError& e) {
    if (e.get_exit_code() == 0) return app.exit(e);
    const std::vector<std::string> rest = app.remaining(true);
    const bool unknown = e.get_name() == "RequiredError" && !rest.empty() && rest[0][0] != '-';
    fmt::print(stderr, "mapletctl: {} (mapletctl --help, mapletctl COMMAND --help)\n",
               unknown ? fmt::format("there is no command '{}'", rest[0]) : e.what());
    return 2;
  }
  return 0;
}

}  // namespace maplet::ctl
