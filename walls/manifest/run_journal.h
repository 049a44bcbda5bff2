#pragma once

#include <cstddef>
#include <filesystem>
#include <optional>
#include <string>
#include <vector>

#include "core/file.h"

namespace hpr {

/// What survives the jobs of one run: the records of its frames, one JSON object a line, and why jobs were started
/// again. Written by rank 0 and the supervisor, in turn.
class RunJournal {
 public:
  /// The supervisor's, a TemporaryFile. Throws Error (Io).
  explicit RunJournal(TemporaryFile file = {});
  /// A job's: the file the supervisor named in the environment; none where nobody supervises.
  [[nodiscard]] static std::optional<RunJournal> of_supervisor();

  /// A job of a run that knows its last frame begins to draw the first of those that are left.
  void add_begin();
  /// A frame is drawn and shown.
  void add_frame(const std::string& record);
  /// Adds a command line that changed something about the run.
  void add_command(const std::string& line);
  void add_restart(const std::string& why);
  /// Adds a record of an earlier restart, as Entries::restarts has them.
  void keep_restart(const std::string& record);
  /// The run came to its end, whatever its exit code.
  void add_end();

  struct Entries {
    std::string secret;                 ///< of the run: who knows it is one of its jobs
    std::vector<std::string> frames;    ///< records, in order
    std::vector<std::string> restarts;  ///< JSON objects: the frame that was to come, and why
    std::vector<std::string> commands;  ///< lines, in order
    std::size_t begun = 0;              ///< jobs that came to draw, of a run that knows its last frame
    bool ended = false;
  };
  /// A last line that was cut short is none.
  [[nodiscard]] Entries read() const;

  /// For the environment of a job.
  static constexpr const char* kVariable = "HPR_RUN_JOURNAL";
  [[nodiscard]] const std::filesystem::path& path() const { return path_; }

 private:
  explicit RunJournal(std::filesystem::path path) : path_(std::move(path)) {}
  void append(const std::string& line) const;

  std::optional<TemporaryFile> file_;  ///< the supervisor's
  std::filesystem::path path_;
};

}  // namespace hpr
