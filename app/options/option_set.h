#pragma once

#include <cstdint>
#include <functional>
#include <memory>
#include <optional>
#include <string>
#include <string_view>
#include <vector>

namespace CLI {
class App;
class Option;
}  // namespace CLI

/// The options of commands, declared once: the command line, its help and docs/cli.md come from what is declared here.
/// A thin layer over CLI11, whose header only option_set.cpp includes: it takes a second or more to compile.
namespace hpr {

/// The heading of the settings of pictures in help. They stand once in docs/cli.md, not with every command.
inline constexpr const char* kSettingsGroup = "Settings";

/// A handle to one declared option. Its setters return the handle, so that a declaration is one expression.
class Option {
 public:
  explicit Option(CLI::Option* option) : option_(option) {}

  // NOLINTBEGIN(modernize-use-nodiscard): calls are chained, and what the last one returns may be left
  /// What help calls the value: "FILE.json".
  Option type(const std::string& name) const;
  /// Help shows the value the variable has now.
  Option show_default() const;
  /// Help shows this as the value the option has when it is not given.
  Option default_text(const std::string& text) const;
  Option required() const;
  /// Values from `low` to `high`, both included; others are usage errors. For variables of the same type.
  Option range(int low, int high) const;
  Option range(std::uint32_t low, std::uint32_t high) const;
  Option range(std::uint64_t low, std::uint64_t high) const;
  Option range(double low, double high) const;
  /// A number with one of these units, each with the factor it stands for.
  Option units(const std::vector<std::pair<std::string, double>>& units) const;
  Option choices(const std::vector<std::string>& names) const;
  /// `problem` returns what is wrong with a value; an empty text: nothing.
  Option check(const std::function<std::string(const std::string&)>& problem) const;
  /// `use` is called with every value that is not empty, before options of commands below get theirs; what it throws
  /// leaves the parser.
  Option each(const std::function<void(const std::string&)>& use) const;
  /// A list whose entries are separated by commas.
  Option list() const;
  /// May be given several times; each time with one value.
  Option repeats() const;
  /// Given several times, the last one counts.
  Option last_counts() const;
  Option needs(const Option& other) const;
  Option excludes(const Option& other) const;
  /// Help lists it under this heading.
  Option group(const std::string& heading) const;
  /// Help does not list it.
  Option hidden() const { return group(""); }
  // NOLINTEND(modernize-use-nodiscard)

  /// Whether the command line has it. Known once the command line was parsed.
  [[nodiscard]] bool specified() const;
  /// "--size".
  [[nodiscard]] std::string name() const;

 private:
  CLI::Option* option_;
};

/// An option as it was given: its long name without dashes, and the value it got.
struct GivenOption {
  std::string name;
  std::string value;
  bool is_flag = false;  ///< has no value of its own
};

/// The options of one command.
class OptionSet {
 public:
  explicit OptionSet(CLI::App* app) : app_(app) {}

  /// Declares an option, "-o,--output", or a positional, "scene". Its value goes to `value`, which outlives parsing.
  Option option(const std::string& names, std::string& value, const std::string& help) const;
  Option option(const std::string& names, int& value, const std::string& help) const;
  Option option(const std::string& names, std::optional<int>& value, const std::string& help) const;
  Option option(const std::string& names, std::uint32_t& value, const std::string& help) const;
  Option option(const std::string& names, std::uint64_t& value, const std::string& help) const;
  Option option(const std::string& names, double& value, const std::string& help) const;
  Option option(const std::string& names, std::optional<double>& value, const std::string& help) const;
  Option option(const std::string& names, std::vector<std::string>& value, const std::string& help) const;
  /// `parse` is called with the value when the option is given; what it throws leaves the parser.
  Option option(const std::string& names, const std::function<void(const std::string&)>& parse,
                const std::string& help) const;

  /// Declares a flag, which sets `value`; also --name=false.
  Option flag(const std::string& names, bool& value, const std::string& help) const;
  /// A flag that counts: -v, -vv.
  Option flag(const std::string& names, int& value, const std::string& help) const;
  /// A flag that may have a value, --web or --web=ADDRESS; without one it is "true".
  Option flag(const std::string& names, std::string& value, const std::string& help) const;
  /// A flag and its opposite, "--indirect,!--no-indirect"; the last one counts.
  Option flag(const std::string& names, const std::function<void(bool)>& set, const std::string& help) const;

  /// An option that was declared before, by its name with dashes.
  [[nodiscard]] Option declared(const std::string& name) const;
  /// All arguments from the first that is no option on are kept as they are, also those that look like options; see
  /// remaining().
  void keep_remaining() const;
  [[nodiscard]] std::vector<std::string> remaining() const;
  /// The options that were given to this command and to those above it.
  [[nodiscard]] std::vector<GivenOption> specified() const;

 private:
  CLI::App* app_;
};

class Command;

/// The commands of the program with their options, and the command line as it was parsed.
class CommandLine {
 public:
  /// `name` and `summary`: of the program. `version`: what --version prints.
  CommandLine(const std::string& name, const std::string& summary, const std::string& version);
  ~CommandLine();
  CommandLine(const CommandLine&) = delete;
  CommandLine& operator=(const CommandLine&) = delete;

  /// Options that stand before and after any command.
  [[nodiscard]] OptionSet everywhere();
  /// Declares a command and those below it.
  void add(std::unique_ptr<Command> command);

  /// Parses the arguments after the program's name. Returns the command they name; null where they request help or the
  /// version, which is printed where `prints`. Throws Error (Usage).
  [[nodiscard]] Command* parse(const std::vector<std::string>& arguments, bool prints);
  /// The help of the program.
  [[nodiscard]] std::string help() const;
  /// Every command and option as docs/cli.md lists them.
  [[nodiscard]] std::string markdown() const;

 private:
  struct Declared;
  void declare(Declared& parent, std::unique_ptr<Command> command);

  std::unique_ptr<Declared> root_;
};

}  // namespace hpr
