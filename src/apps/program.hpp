// What the programs have in common: they end in words and with one of these statuses.
#pragma once

#include "src/run/run.hpp"

#include <string>

namespace CLI {
class App;
class ParseError;
} // namespace CLI

namespace spherecut::program {

inline constexpr int status_check_failed = 1;
inline constexpr int status_bad_input = 2;
inline constexpr int status_numerical = 3;

/// Runs `run(argc, argv)` and returns its status, or complains of what it throws: 2 for unusable input, 3 for a
/// numerical failure, 130 for an interrupt. To be returned from main().
int start(int argc, char** argv, int (*run)(int, char**));

/// Says what is wrong on the standard error and returns `status`.
int complain(const std::string& message, int status);

/// What a command line that cannot be read has wrong: what nobody knows comes before what is missing, which may be no
/// more than a mistyped option.
std::string what_is_wrong(const CLI::App& commands, int argc, char** argv, const CLI::ParseError& error);

/// What a command says is its result where it writes no files. Said in vain it has failed, unless its reader has gone
/// and wants no more (a pipe to `head`).
int ended(int status);

int say_interrupted(const std::string& text);

/// Status of a run or a session that has come to this end.
int status_of(app::RunEnd end);

/// Threads of a solve where the command line does not say: one a core but `reserved` of them, 1 to 16.
int threads_unless_told(int reserved);

/// What the option --threads is for.
std::string about_threads(const std::string& by_default);

/// Becomes the program `name` that lies beside this one, with these arguments (ended by null). Returns where it cannot.
int pass_on(const std::string& name, char** arguments);

/// What libraries below would wait for for ever, or end the program by: told before there is anything to lose. Bodies
/// that are made in the background of a loop have threads of their own.
void require_resources(bool is_real_time);

} // namespace spherecut::program
