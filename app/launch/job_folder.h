#pragma once

#include <filesystem>
#include <vector>

namespace hpr {

/// Where the MPI job of one host keeps its files: a folder of its own below temporary_folder(), for sockets and
/// tables, and one in /dev/shm, for messages. Both go with this object. Those of launchers that were killed, known by
/// their lock, which nobody holds, are removed by the next one of the same user.
class JobFolder {
 public:
  /// Where a folder cannot be made there is none, and MPI chooses. None at all for jobs of several hosts.
  JobFolder();
  ~JobFolder();
  JobFolder(const JobFolder&) = delete;
  JobFolder& operator=(const JobFolder&) = delete;

  /// In a child between fork and exec: tells MPI of the folders, unless the user did, and has the program that is
  /// started hold their locks too.
  void pass_on() const;

 private:
  struct Locked {
    const char* variable;  ///< of the environment, which names it to MPI
    std::filesystem::path path;
    int lock;
  };
  void make(const std::filesystem::path& parent, const char* variable);

  std::vector<Locked> folders_;
};

}  // namespace hpr
