#include <dlfcn.h>
#include <execinfo.h>
#include <fcntl.h>
#include <link.h>
#include <mpi.h>
#include <sys/socket.h>
#include <sys/stat.h>
#include <sys/syscall.h>
#include <unistd.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cerrno>
#include <cstdarg>
#include <cstdint>
#include <cstdio>
#include <cstdlib>
#include <cstring>
#include <new>
#include <string_view>

// Lets one call of the program fail: loaded by LD_PRELOAD into hpr and what it starts, steered by
//   HPR_FAULTS=KIND:N[:RANK]   the N-th call of a kind fails, from 1; in the rank of that number, else in the process
//                              that is no rank of a job
//                              (N = 0: none does, and FILE gets of each location that makes some a hash and the number
//                              of the first, 8 bytes each)
//   HPR_FAULTS_MET=FILE        is written when it does: the call, and where it was made in hpr
// Calls count from the first instruction of main() on, in programs called hpr, where hpr itself makes them: directly,
// or by way of libstdc++, libfmt or libc. What Mesa, Embree, TBB or MPI do for themselves never fails.
namespace {

/// The addresses of a loaded object.
struct Range {
  std::uintptr_t begin = 0;
  std::uintptr_t end = 0;
  [[nodiscard]] bool contains(const void* address) const {
    const auto at = reinterpret_cast<std::uintptr_t>(address);
    return at >= begin && at < end;
  }
};

/// Whose calls count, and by whose hands.
struct Objects {
  Range program;
  std::array<Range, 4> helpers{};  ///< this library, libstdc++, libfmt, libc
};

// The hooks are plain functions of C: what they know is global.
Objects objects;
std::string_view wanted_kind;
long wanted_number = 0;
std::atomic<bool> counting{false};
std::atomic<long> calls{0};        ///< so far
int locations_file = -1;           ///< N = 0: where those of new locations go
thread_local bool inside = false;  ///< of a hook: what it calls does not count

int note_object(dl_phdr_info* info, std::size_t /*size*/, void* /*data*/) {
  Range range{~std::uintptr_t{0}, 0};
  for (int i = 0; i < info->dlpi_phnum; ++i) {
    const auto& part = info->dlpi_phdr[i];
    if (part.p_type != PT_LOAD) continue;
    range.begin = std::min<std::uintptr_t>(range.begin, info->dlpi_addr + part.p_vaddr);
    range.end = std::max<std::uintptr_t>(range.end, info->dlpi_addr + part.p_vaddr + part.p_memsz);
  }
  constexpr std::array<const char*, 4> kHelpers{"libhpr_faults", "libstdc++", "libfmt", "libc.so"};
  for (std::size_t i = 0; i < kHelpers.size(); ++i) {
    if (std::strstr(info->dlpi_name, kHelpers.at(i)) != nullptr) objects.helpers.at(i) = range;
  }
  if (*info->dlpi_name == '\0' && objects.program.end == 0) objects.program = range;
  return 0;
}

bool is_helper(const void* address) {
  return std::any_of(objects.helpers.begin(), objects.helpers.end(),
                     [&](const Range& range) { return range.contains(address); });
}

/// Whether the program made a call that returns to `address`.
bool is_programs(const void* address) {
  if (objects.program.contains(address)) return true;
  if (!is_helper(address)) return false;
  std::array<void*, 24> frames{};
  const int count = ::backtrace(frames.data(), static_cast<int>(frames.size()));
  for (int i = 0; i < count; ++i) {
    const void* const frame = frames.at(static_cast<std::size_t>(i));
    if (objects.program.contains(frame)) return true;
    if (!is_helper(frame)) return false;
  }
  return false;
}

/// By system calls: whatever the program would call may be what fails.
void report(const char* call) {
  const char* const path = std::getenv("HPR_FAULTS_MET");
  if (path == nullptr) return;
  const long file = ::syscall(SYS_openat, AT_FDCWD, path, O_WRONLY | O_CREAT | O_APPEND, 0600);
  std::array<char, 2048> text{};
  int length = std::snprintf(text.data(), text.size(), "%s\n", call);
  std::array<void*, 40> frames{};
  const int count = ::backtrace(frames.data(), static_cast<int>(frames.size()));
  for (int i = 0; i < count && static_cast<std::size_t>(length) + 32 < text.size(); ++i) {
    const void* const frame = frames.at(static_cast<std::size_t>(i));
    if (!objects.program.contains(frame)) continue;
    length +=
        std::snprintf(text.data() + length, text.size() - static_cast<std::size_t>(length), "0x%lx\n",
                      static_cast<unsigned long>(reinterpret_cast<std::uintptr_t>(frame) - objects.program.begin - 1));
  }
  ::syscall(SYS_write, file, text.data(), length);
  ::syscall(SYS_close, file);
}

/// Writes where a call is made, the five innermost functions of the program on the stack, if it is the first one there.
void note_location(long number) {
  static std::array<std::atomic<std::uint64_t>, 1U << 16U> locations{};
  std::array<void*, 32> frames{};
  const int count = ::backtrace(frames.data(), static_cast<int>(frames.size()));
  std::uint64_t location = 1;
  int functions = 0;
  for (int i = 0; i < count && functions < 5; ++i) {
    const void* const frame = frames.at(static_cast<std::size_t>(i));
    if (!objects.program.contains(frame)) continue;
    location = (location ^ (reinterpret_cast<std::uintptr_t>(frame) - objects.program.begin)) * 0x9E3779B97F4A7C15U;
    ++functions;
  }
  for (std::size_t i = location >> 48U, tries = 0; tries < locations.size(); ++tries, i = (i + 1) % locations.size()) {
    std::uint64_t found = 0;
    if (locations.at(i).compare_exchange_strong(found, location)) {
      const std::array<std::uint64_t, 2> record{location, static_cast<std::uint64_t>(number)};
      ::syscall(SYS_write, locations_file, record.data(), sizeof record);
      return;
    }
    if (found == location) return;
  }
}

bool is_wanted(long number) {
  if (wanted_number > 0) return number == wanted_number;
  if (locations_file >= 0) note_location(number);
  return false;
}

/// Whether this call, which returns to `address`, is the one that is to fail.
bool fails(std::string_view kind, const char* call, const void* address) {
  if (!counting || inside || kind != wanted_kind) return false;
  inside = true;
  const bool met = is_programs(address) && is_wanted(++calls);
  if (met) report(call);
  inside = false;
  return met;
}

bool is_regular(int file) {
  struct stat status {};
  return ::fstat(file, &status) == 0 && S_ISREG(status.st_mode);
}

/// The function that the program would have called.
template <typename Function>
Function* next(const char* name) {
  return reinterpret_cast<Function*>(::dlsym(RTLD_NEXT, name));
}

int fail_with(int error) {
  errno = error;
  return -1;
}

using Main = int (*)(int, char**, char**);
Main program_main = nullptr;

/// The rank of HPR_FAULTS is this process's.
bool is_meant(const char* rank) {
  const char* const own = std::getenv("OMPI_COMM_WORLD_RANK");
  if (rank == nullptr || own == nullptr) return rank == own;
  return std::strcmp(rank, own) == 0;
}

int counted_main(int argc, char** argv, char** environment) {
  static std::array<char, 64> faults{};
  const char* const text = std::getenv("HPR_FAULTS");
  const char* const name = argc > 0 ? std::strrchr(argv[0], '/') : nullptr;
  if (text != nullptr && name != nullptr && std::strcmp(name, "/hpr") == 0 && std::strlen(text) < faults.size()) {
    std::strcpy(faults.data(), text);
    char* rest = nullptr;
    wanted_kind = ::strtok_r(faults.data(), ":", &rest);
    const char* const number = ::strtok_r(nullptr, ":", &rest);
    wanted_number = number == nullptr ? 0 : std::atol(number);
    ::dl_iterate_phdr(note_object, nullptr);
    std::array<void*, 2> warm{};
    (void)::backtrace(warm.data(), 2);  // loads what it needs
    const bool meant = is_meant(::strtok_r(nullptr, ":", &rest));
    const char* const file = std::getenv("HPR_FAULTS_MET");
    if (meant && wanted_number == 0 && file != nullptr) {
      locations_file = ::open(file, O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0600);
    }
    counting = meant;
  }
  return program_main(argc, argv, environment);
}

}  // namespace

#define HPR_RETURN_ADDRESS __builtin_return_address(0)

// NOLINTBEGIN(bugprone-reserved-identifier,readability-identifier-naming): the names are the C library's
extern "C" {

int __libc_start_main(Main main, int argc, char** argv, void (*init)(), void (*fini)(), void (*loader_fini)(),
                      void* stack_end) {
  program_main = main;
  using Start = int(Main, int, char**, void (*)(), void (*)(), void (*)(), void*);
  return next<Start>("__libc_start_main")(counted_main, argc, argv, init, fini, loader_fini, stack_end);
}

// Memory. What the C library has under these names is there before dlsym() works.
void* __libc_malloc(std::size_t);
void* __libc_calloc(std::size_t, std::size_t);
void* __libc_realloc(void*, std::size_t);
void* __libc_memalign(std::size_t, std::size_t);

void* malloc(std::size_t bytes) {
  return fails("alloc", "malloc", HPR_RETURN_ADDRESS) ? (errno = ENOMEM, nullptr) : __libc_malloc(bytes);
}
void* calloc(std::size_t count, std::size_t bytes) {
  return fails("alloc", "calloc", HPR_RETURN_ADDRESS) ? (errno = ENOMEM, nullptr) : __libc_calloc(count, bytes);
}
void* realloc(void* memory, std::size_t bytes) {
  return fails("alloc", "realloc", HPR_RETURN_ADDRESS) ? (errno = ENOMEM, nullptr) : __libc_realloc(memory, bytes);
}
void* aligned_alloc(std::size_t alignment, std::size_t bytes) {
  return fails("alloc", "aligned_alloc", HPR_RETURN_ADDRESS) ? (errno = ENOMEM, nullptr)
                                                             : __libc_memalign(alignment, bytes);
}
int posix_memalign(void** memory, std::size_t alignment, std::size_t bytes) {
  if (fails("alloc", "posix_memalign", HPR_RETURN_ADDRESS)) return ENOMEM;
  void* const got = __libc_memalign(alignment, bytes);
  if (got == nullptr) return ENOMEM;
  *memory = got;
  return 0;
}

// Files.
ssize_t write(int file, const void* bytes, std::size_t count) {
  if (is_regular(file) && fails("write", "write", HPR_RETURN_ADDRESS)) return fail_with(ENOSPC);
  static auto* const real = next<ssize_t(int, const void*, std::size_t)>("write");
  return real(file, bytes, count);
}
ssize_t pwrite(int file, const void* bytes, std::size_t count, off_t at) {
  if (is_regular(file) && fails("write", "pwrite", HPR_RETURN_ADDRESS)) return fail_with(ENOSPC);
  static auto* const real = next<ssize_t(int, const void*, std::size_t, off_t)>("pwrite");
  return real(file, bytes, count, at);
}
int fsync(int file) {
  if (fails("fsync", "fsync", HPR_RETURN_ADDRESS)) return fail_with(EIO);
  static auto* const real = next<int(int)>("fsync");
  return real(file);
}
int rename(const char* from, const char* to) {
  if (fails("rename", "rename", HPR_RETURN_ADDRESS)) return fail_with(EIO);
  static auto* const real = next<int(const char*, const char*)>("rename");
  return real(from, to);
}
int linkat(int from_folder, const char* from, int to_folder, const char* to, int flags) {
  if (fails("rename", "linkat", HPR_RETURN_ADDRESS)) return fail_with(EIO);
  static auto* const real = next<int(int, const char*, int, const char*, int)>("linkat");
  return real(from_folder, from, to_folder, to, flags);
}
/// Files that are made: "open" finds no room for them, "unnamed" a file system that has none without a name.
int open(const char* path, int flags, ...) {
  const bool unnamed = (flags & O_TMPFILE) == O_TMPFILE;
  mode_t mode = 0;
  if (unnamed || (flags & O_CREAT) != 0) {
    std::va_list arguments;
    va_start(arguments, flags);
    mode = va_arg(arguments, mode_t);
    va_end(arguments);
    if (fails("open", "open", HPR_RETURN_ADDRESS)) return fail_with(ENOSPC);
    if (unnamed && fails("unnamed", "open", HPR_RETURN_ADDRESS)) return fail_with(EOPNOTSUPP);
  }
  static auto* const real = next<int(const char*, int, ...)>("open");
  return real(path, flags, mode);
}

// Sockets.
int socket(int domain, int type, int protocol) noexcept {
  if (fails("socket", "socket", HPR_RETURN_ADDRESS)) return fail_with(EMFILE);
  static auto* const real = next<int(int, int, int)>("socket");
  return real(domain, type, protocol);
}
int connect(int file, const sockaddr* address, socklen_t length) {
  if (fails("socket", "connect", HPR_RETURN_ADDRESS)) return fail_with(ECONNREFUSED);
  static auto* const real = next<int(int, const sockaddr*, socklen_t)>("connect");
  return real(file, address, length);
}
int accept(int file, sockaddr* address, socklen_t* length) {
  if (fails("socket", "accept", HPR_RETURN_ADDRESS)) return fail_with(EMFILE);
  static auto* const real = next<int(int, sockaddr*, socklen_t*)>("accept");
  return real(file, address, length);
}
int accept4(int file, sockaddr* address, socklen_t* length, int flags) {
  if (fails("socket", "accept4", HPR_RETURN_ADDRESS)) return fail_with(EMFILE);
  static auto* const real = next<int(int, sockaddr*, socklen_t*, int)>("accept4");
  return real(file, address, length, flags);
}
ssize_t send(int file, const void* bytes, std::size_t count, int flags) {
  if (fails("socket", "send", HPR_RETURN_ADDRESS)) return fail_with(ECONNRESET);
  static auto* const real = next<ssize_t(int, const void*, std::size_t, int)>("send");
  return real(file, bytes, count, flags);
}
ssize_t sendmsg(int file, const msghdr* message, int flags) {
  if (fails("socket", "sendmsg", HPR_RETURN_ADDRESS)) return fail_with(ECONNRESET);
  static auto* const real = next<ssize_t(int, const msghdr*, int)>("sendmsg");
  return real(file, message, flags);
}
ssize_t recv(int file, void* bytes, std::size_t count, int flags) {
  if (fails("socket", "recv", HPR_RETURN_ADDRESS)) return fail_with(ECONNRESET);
  static auto* const real = next<ssize_t(int, void*, std::size_t, int)>("recv");
  return real(file, bytes, count, flags);
}

// Messages.
int MPI_Isend(const void* bytes, int count, MPI_Datatype type, int to, int tag, MPI_Comm comm, MPI_Request* request) {
  if (fails("mpi", "MPI_Isend", HPR_RETURN_ADDRESS)) return MPI_ERR_OTHER;
  static auto* const real = next<decltype(MPI_Isend)>("PMPI_Isend");
  return real(bytes, count, type, to, tag, comm, request);
}
/// Called until a message is there: those that find one count.
int MPI_Improbe(int from, int tag, MPI_Comm comm, int* flag, MPI_Message* message, MPI_Status* status) {
  static auto* const real = next<decltype(MPI_Improbe)>("PMPI_Improbe");
  const int code = real(from, tag, comm, flag, message, status);
  return code == MPI_SUCCESS && *flag != 0 && fails("mpi", "MPI_Improbe", HPR_RETURN_ADDRESS) ? MPI_ERR_OTHER : code;
}
int MPI_Imrecv(void* bytes, int count, MPI_Datatype type, MPI_Message* message, MPI_Request* request) {
  if (fails("mpi", "MPI_Imrecv", HPR_RETURN_ADDRESS)) return MPI_ERR_OTHER;
  static auto* const real = next<decltype(MPI_Imrecv)>("PMPI_Imrecv");
  return real(bytes, count, type, message, request);
}
int MPI_Ireduce(const void* from, void* to, int count, MPI_Datatype type, MPI_Op operation, int root, MPI_Comm comm,
                MPI_Request* request) {
  if (fails("mpi", "MPI_Ireduce", HPR_RETURN_ADDRESS)) return MPI_ERR_OTHER;
  static auto* const real = next<decltype(MPI_Ireduce)>("PMPI_Ireduce");
  return real(from, to, count, type, operation, root, comm, request);
}

}  // extern "C"
// NOLINTEND(bugprone-reserved-identifier,readability-identifier-naming)

namespace {

void* allocate(std::size_t bytes, std::size_t alignment, const void* address) {
  if (fails("alloc", "operator new", address)) return nullptr;
  return alignment == 0 ? __libc_malloc(bytes) : __libc_memalign(alignment, bytes);
}

void* allocate_or_throw(std::size_t bytes, std::size_t alignment, const void* address) {
  void* const memory = allocate(bytes == 0 ? 1 : bytes, alignment, address);
  if (memory == nullptr) throw std::bad_alloc();
  return memory;
}

}  // namespace

void* operator new(std::size_t bytes) {
  return allocate_or_throw(bytes, 0, HPR_RETURN_ADDRESS);
}
void* operator new[](std::size_t bytes) {
  return allocate_or_throw(bytes, 0, HPR_RETURN_ADDRESS);
}
void* operator new(std::size_t bytes, std::align_val_t alignment) {
  return allocate_or_throw(bytes, static_cast<std::size_t>(alignment), HPR_RETURN_ADDRESS);
}
void* operator new[](std::size_t bytes, std::align_val_t alignment) {
  return allocate_or_throw(bytes, static_cast<std::size_t>(alignment), HPR_RETURN_ADDRESS);
}
void* operator new(std::size_t bytes, const std::nothrow_t& /*tag*/) noexcept {
  return allocate(bytes, 0, HPR_RETURN_ADDRESS);
}
void* operator new[](std::size_t bytes, const std::nothrow_t& /*tag*/) noexcept {
  return allocate(bytes, 0, HPR_RETURN_ADDRESS);
}
void operator delete(void* memory) noexcept {
  std::free(memory);
}
void operator delete[](void* memory) noexcept {
  std::free(memory);
}
void operator delete(void* memory, std::size_t /*bytes*/) noexcept {
  std::free(memory);
}
void operator delete[](void* memory, std::size_t /*bytes*/) noexcept {
  std::free(memory);
}
void operator delete(void* memory, std::align_val_t /*alignment*/) noexcept {
  std::free(memory);
}
void operator delete[](void* memory, std::align_val_t /*alignment*/) noexcept {
  std::free(memory);
}
void operator delete(void* memory, std::size_t /*bytes*/, std::align_val_t /*alignment*/) noexcept {
  std::free(memory);
}
void operator delete[](void* memory, std::size_t /*bytes*/, std::align_val_t /*alignment*/) noexcept {
  std::free(memory);
}
void operator delete(void* memory, const std::nothrow_t& /*tag*/) noexcept {
  std::free(memory);
}
void operator delete[](void* memory, const std::nothrow_t& /*tag*/) noexcept {
  std::free(memory);
}
