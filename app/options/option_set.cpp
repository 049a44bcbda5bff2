#include "app/options/option_set.h"

#include <fmt/format.h>
#include <fmt/ranges.h>

#include <CLI/CLI.hpp>
#include <algorithm>
#include <cctype>
#include <map>
#include <type_traits>
#include <utility>

#include "app/command.h"
#include "core/error.h"
#include "core/text.h"

namespace hpr {

Option Option::type(const std::string& name) const {
  option_->type_name(name);
  return *this;
}

Option Option::show_default() const {
  option_->capture_default_str();
  return *this;
}

Option Option::default_text(const std::string& text) const {
  option_->default_str(text);
  return *this;
}

Option Option::required() const {
  option_->required();
  return *this;
}

namespace {

/// CLI11's own text for a range is left out: help has ours.
template <typename Number>
void set_range(CLI::Option& option, Number low, Number high) {
  CLI::Range range(low, high);
  range.description("");
  option.check(range);
  option.type_name(fmt::format("{} {} to {}", std::is_floating_point_v<Number> ? "FLOAT" : "INT", low, high));
}

}  // namespace

Option Option::range(int low, int high) const {
  set_range(*option_, low, high);
  return *this;
}

Option Option::range(std::uint32_t low, std::uint32_t high) const {
  set_range(*option_, low, high);
  return *this;
}

Option Option::range(std::uint64_t low, std::uint64_t high) const {
  set_range(*option_, low, high);
  return *this;
}

Option Option::range(double low, double high) const {
  set_range(*option_, low, high);
  return *this;
}

Option Option::units(const std::vector<std::pair<std::string, double>>& units) const {
  option_->transform(CLI::AsNumberWithUnit(std::map<std::string, double>(units.begin(), units.end())));
  return *this;
}

Option Option::choices(const std::vector<std::string>& names) const {
  option_->check(CLI::IsMember(names));
  return *this;
}

Option Option::check(const std::function<std::string(const std::string&)>& problem) const {
  option_->check(problem);
  return *this;
}

Option Option::each(const std::function<void(const std::string&)>& use) const {
  option_->each([use](const std::string& value) {
    if (!value.empty()) use(value);
  });
  return *this;
}

Option Option::list() const {
  option_->delimiter(',');
  return *this;
}

Option Option::repeats() const {
  option_->multi_option_policy(CLI::MultiOptionPolicy::TakeAll)->allow_extra_args(false);
  return *this;
}

Option Option::last_counts() const {
  option_->multi_option_policy(CLI::MultiOptionPolicy::TakeLast);
  return *this;
}

Option Option::needs(const Option& other) const {
  option_->needs(other.option_);
  return *this;
}

Option Option::excludes(const Option& other) const {
  option_->excludes(other.option_);
  return *this;
}

Option Option::group(const std::string& heading) const {
  option_->group(heading);
  return *this;
}

bool Option::specified() const {
  return option_->count() > 0;
}

std::string Option::name() const {
  return option_->get_name();
}

Option OptionSet::option(const std::string& names, std::string& value, const std::string& help) const {
  return Option(app_->add_option(names, value, help));
}

Option OptionSet::option(const std::string& names, int& value, const std::string& help) const {
  return Option(app_->add_option(names, value, help));
}

Option OptionSet::option(const std::string& names, std::optional<int>& value, const std::string& help) const {
  return Option(app_->add_option(names, value, help));
}

Option OptionSet::option(const std::string& names, std::uint32_t& value, const std::string& help) const {
  return Option(app_->add_option(names, value, help));
}

Option OptionSet::option(const std::string& names, std::uint64_t& value, const std::string& help) const {
  return Option(app_->add_option(names, value, help));
}

Option OptionSet::option(const std::string& names, double& value, const std::string& help) const {
  return Option(app_->add_option(names, value, help));
}

Option OptionSet::option(const std::string& names, std::optional<double>& value, const std::string& help) const {
  return Option(app_->add_option(names, value, help));
}

Option OptionSet::option(const std::string& names, std::vector<std::string>& value, const std::string& help) const {
  return Option(app_->add_option(names, value, help));
}

Option OptionSet::option(const std::string& names, const std::function<void(const std::string&)>& parse,
                         const std::string& help) const {
  return Option(app_->add_option_function(names, parse, help));
}

Option OptionSet::flag(const std::string& names, bool& value, const std::string& help) const {
  return Option(app_->add_flag(names, value, help));
}

Option OptionSet::flag(const std::string& names, int& value, const std::string& help) const {
  return Option(app_->add_flag(names, value, help));
}

Option OptionSet::flag(const std::string& names, std::string& value, const std::string& help) const {
  return Option(app_->add_flag(names, value, help));
}

Option OptionSet::flag(const std::string& names, const std::function<void(bool)>& set, const std::string& help) const {
  return Option(app_->add_flag_function(
                        names, [set](std::int64_t count) { set(count > 0); }, help)
                    ->multi_option_policy(CLI::MultiOptionPolicy::TakeLast));
}

Option OptionSet::declared(const std::string& name) const {
  return Option(app_->get_option(name));
}

void OptionSet::keep_remaining() const {
  app_->prefix_command();
  app_->fallthrough(false);
}

std::vector<std::string> OptionSet::remaining() const {
  return app_->remaining();
}

std::vector<GivenOption> OptionSet::specified() const {
  std::vector<GivenOption> all;
  for (const CLI::App* level = app_; level != nullptr; level = level->get_parent()) {
    for (const CLI::Option* option : level->get_options()) {
      if (option->count() == 0 || option->get_lnames().empty()) continue;
      all.push_back({option->get_lnames().front(), fmt::format("{}", fmt::join(option->reduced_results(), ",")),
                     option->get_expected_max() == 0});
    }
  }
  return all;
}

namespace {

std::vector<std::string> names_of(const std::vector<const CLI::App*>& subcommands) {
  std::vector<std::string> names;
  names.reserve(subcommands.size());
  for (const CLI::App* subcommand : subcommands) names.push_back(subcommand->get_name());
  return names;
}

/// The chain of subcommands that the arguments name: `app`, or `wall`, or `wall run`, as far as it goes.
const CLI::App* innermost(const CLI::App* app, const std::vector<std::string>& arguments) {
  for (const std::string& argument : arguments) {
    if (argument.starts_with('-')) break;
    const auto children = app->get_subcommands([&](const CLI::App* child) { return child->get_name() == argument; });
    if (children.empty()) break;
    app = children.front();
  }
  return app;
}

/// "hpr wall run".
std::string full_name(const CLI::App* app) {
  std::string name = app->get_name();
  for (const CLI::App* above = app->get_parent(); above != nullptr; above = above->get_parent()) {
    name.insert(0, above->get_name() + " ");
  }
  return name;
}

std::vector<std::string> long_options(const CLI::App* app) {
  std::vector<std::string> names;
  for (; app != nullptr; app = app->get_parent()) {
    for (const CLI::Option* option : app->get_options()) {
      for (const std::string& name : option->get_lnames()) names.push_back("--" + name);
    }
  }
  return names;
}

/// CLI11's complaint in our form: what, and the nearest name.
Error usage_error(const CLI::App& app, const std::vector<std::string>& arguments, const CLI::ParseError& error) {
  const CLI::App* const context = innermost(&app, arguments);
  const std::string command = full_name(context);
  const std::string help = fmt::format("see '{} --help'", command);
  if (dynamic_cast<const CLI::ExtrasError*>(&error) != nullptr) {
    const auto known = long_options(context);
    for (const std::string& argument : arguments) {
      const std::string option = argument.substr(0, argument.find('='));
      if (!option.starts_with("--") || std::ranges::find(known, option) != known.end()) continue;
      const auto nearest = nearest_name(option, known);
      return {ExitCode::Usage, fmt::format("unknown option '{}'", printable(option)),
              nearest ? fmt::format("did you mean '{}'? {}", *nearest, help) : help};
    }
  }
  const auto subcommands = context->get_subcommands([](const CLI::App*) { return true; });
  if (context != &app && !subcommands.empty()) {
    const std::vector<std::string> choices = names_of(subcommands);
    const auto argument = std::ranges::find_if(arguments.begin() + 1, arguments.end(),
                                               [](const std::string& w) { return !w.starts_with('-'); });
    if (argument == arguments.end())
      return {ExitCode::Usage, fmt::format("{} needs a subcommand", command),
              fmt::format("choices: {}", fmt::join(choices, ", "))};
    return {ExitCode::Usage, fmt::format("unknown subcommand '{} {}'", command, printable(*argument)),
            unknown_name_hint(*argument, choices)};
  }
  if (app.get_subcommands().empty() && dynamic_cast<const CLI::RequiredError*>(&error) != nullptr) {
    return {ExitCode::Usage, fmt::format("{} needs a command", command),
            fmt::format("choices: {}", fmt::join(names_of(subcommands), ", "))};
  }
  return {ExitCode::Usage, fmt::format("{}: {}", command, error.what()), help};
}

/// An unset variable of a script is no wish to leave an option away.
void refuse_empty_values(const CLI::App& app) {
  for (const CLI::Option* option : app.get_options()) {
    if (option->get_positional() || option->count() == 0 || option->get_expected_min() == 0) continue;
    for (const std::string& value : option->results()) {
      if (!value.empty()) continue;
      throw Error(ExitCode::Usage, fmt::format("{} has an empty value", option->get_name()),
                  "give it one, or leave the option out");
    }
  }
  for (const CLI::App* child : app.get_subcommands()) refuse_empty_values(*child);
}

/// As a cell of a Markdown table.
std::string cell(std::string text) {
  for (std::size_t at = text.find('|'); at != std::string::npos; at = text.find('|', at + 2)) text.insert(at, 1, '\\');
  return text;
}

std::string as_sentence(std::string text) {
  if (text.empty()) return text;
  text.front() = static_cast<char>(std::toupper(static_cast<unsigned char>(text.front())));
  return text.back() == '?' ? text : text + ".";
}

std::string option_rows(const CLI::App& app) {
  std::string rows;
  bool has_settings = false;
  for (const CLI::Option* option : app.get_options()) {
    if (option->get_group() == kSettingsGroup) has_settings = true;
    if (option->get_group() == kSettingsGroup || option->get_group().empty()) continue;
    if (option->get_name(false, true) == "-h,--help") continue;
    const std::string type = option->get_items_expected() == 0 ? "" : option->get_type_name();
    rows += fmt::format("| `{}`{} | {} | {} | {} |\n", option->get_name(true, true),
                        option->get_required() ? " (required)" : "", cell(type), cell(option->get_default_str()),
                        cell(option->get_description()));
  }
  std::string text = rows.empty() ? "" : "\n| Option | Value | Default | Meaning |\n|---|---|---|---|\n" + rows;
  if (has_settings) text += "\nand the [settings](#settings).\n";
  return text;
}

}  // namespace

struct CommandLine::Declared {
  std::unique_ptr<Command> command;  ///< null: the program itself
  CLI::App* app = nullptr;
  std::unique_ptr<CLI::App> own_app;  ///< the program's
  std::vector<std::unique_ptr<Declared>> children;

  /// The innermost command that the command line names.
  [[nodiscard]] Declared& chosen() {
    for (const auto& child : children) {
      if (app->got_subcommand(child->app)) return child->chosen();
    }
    return *this;
  }

  void write_markdown(std::string& text) const {
    if (command != nullptr && children.empty()) {
      text +=
          fmt::format("\n## `{}`\n\n{}\n{}", full_name(app), as_sentence(app->get_description()), option_rows(*app));
    }
    for (const auto& child : children) child->write_markdown(text);
  }
};

CommandLine::CommandLine(const std::string& name, const std::string& summary, const std::string& version)
    : root_(std::make_unique<Declared>()) {
  root_->own_app = std::make_unique<CLI::App>(summary, name);
  root_->app = root_->own_app.get();
  root_->app->set_version_flag("--version", version);
  root_->app->require_subcommand(1);
  root_->app->fallthrough();
}

CommandLine::~CommandLine() = default;

OptionSet CommandLine::everywhere() {
  return OptionSet(root_->app);
}

void CommandLine::add(std::unique_ptr<Command> command) {
  declare(*root_, std::move(command));
}

void CommandLine::declare(Declared& parent, std::unique_ptr<Command> command) {
  auto declared = std::make_unique<Declared>();
  declared->app = parent.app->add_subcommand(std::string(command->name()), std::string(command->summary()));
  declared->app->fallthrough();
  command->declare(OptionSet(declared->app));
  std::vector<std::unique_ptr<Command>> below = command->subcommands();
  declared->command = std::move(command);
  if (!below.empty()) declared->app->require_subcommand(1);
  for (auto& child : below) declare(*declared, std::move(child));
  parent.children.push_back(std::move(declared));
}

Command* CommandLine::parse(const std::vector<std::string>& arguments, bool prints) {
  CLI::App& app = *root_->app;
  // `hpr help` and `hpr help COMMAND` are other ways to write --help.
  const auto first = std::ranges::find_if(arguments, [](const std::string& argument) { return argument != "help"; });
  std::vector<std::string> parsed(first, arguments.end());
  if (first != arguments.begin()) parsed.emplace_back("--help");
  if (!parsed.front().starts_with('-')) {
    const auto names = names_of(std::as_const(app).get_subcommands([](const CLI::App*) { return true; }));
    if (std::ranges::find(names, parsed.front()) == names.end()) {
      throw Error(ExitCode::Usage, fmt::format("unknown command '{}'", printable(parsed.front())),
                  unknown_name_hint(parsed.front(), names));
    }
  }
  try {
    app.parse(std::vector<std::string>(parsed.rbegin(), parsed.rend()));  // CLI11 takes them last first
  } catch (const CLI::Success& done) {                                    // --help, --version
    if (prints) app.exit(done);
    return nullptr;
  } catch (const CLI::ParseError& error) {
    throw usage_error(app, parsed, error);
  }
  refuse_empty_values(app);
  return root_->chosen().command.get();
}

std::string CommandLine::help() const {
  return root_->app->help();
}

std::string CommandLine::markdown() const {
  std::string text = "\n## Everywhere\n" + option_rows(*root_->app);
  root_->write_markdown(text);
  return text;
}

}  // namespace hpr
