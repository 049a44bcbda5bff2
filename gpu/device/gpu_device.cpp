#include "gpu/device/gpu_device.h"

#include <dlfcn.h>
#include <fmt/format.h>

#include <algorithm>
#include <array>
#include <atomic>
#include <cstring>
#include <memory>
#include <optional>
#include <utility>

#include "core/error.h"
#include "core/log.h"
#include "core/text.h"
#include "gpu/device/gpu_kernel.h"

namespace hpr {
namespace {

constexpr const char* kLibrary = "libvulkan.so.1";
constexpr const char* kValidationLayer = "VK_LAYER_KHRONOS_validation";
constexpr std::string_view kInstall =
    "install Vulkan: apt-get install libvulkan1 mesa-vulkan-drivers, or the driver of the GPU";
constexpr std::uint32_t kVersion = VK_API_VERSION_1_2;

/// A library that is open while this lives.
class Library {
 public:
  Library() : handle_(::dlopen(kLibrary, RTLD_NOW | RTLD_LOCAL)) {
    if (handle_ == nullptr) {
      throw Error(ExitCode::NoDevice, fmt::format("no Vulkan: {} cannot be opened", kLibrary), std::string(kInstall));
    }
  }
  ~Library() { ::dlclose(handle_); }
  Library(const Library&) = delete;
  Library& operator=(const Library&) = delete;

  [[nodiscard]] PFN_vkGetInstanceProcAddr entry() const {
    const auto found = reinterpret_cast<PFN_vkGetInstanceProcAddr>(::dlsym(handle_, "vkGetInstanceProcAddr"));
    if (found == nullptr)
      throw Error(ExitCode::NoDevice, fmt::format("{} is no Vulkan", kLibrary), std::string(kInstall));
    return found;
  }

 private:
  void* handle_;
};

bool has_layer(PFN_vkGetInstanceProcAddr proc, const char* name) {
  const auto list =
      reinterpret_cast<PFN_vkEnumerateInstanceLayerProperties>(proc(nullptr, "vkEnumerateInstanceLayerProperties"));
  std::uint32_t count = 0;
  if (list == nullptr || list(&count, nullptr) != VK_SUCCESS) return false;
  std::vector<VkLayerProperties> layers(count);
  if (list(&count, layers.data()) != VK_SUCCESS) return false;
  return std::ranges::any_of(layers, [&](const VkLayerProperties& l) { return std::strcmp(l.layerName, name) == 0; });
}

/// As the validation layer calls it: counts and logs what is wrong.
VKAPI_ATTR VkBool32 VKAPI_CALL note_finding(VkDebugUtilsMessageSeverityFlagBitsEXT /*severity*/,
                                            VkDebugUtilsMessageTypeFlagsEXT /*types*/,
                                            const VkDebugUtilsMessengerCallbackDataEXT* finding, void* count) {
  ++*static_cast<std::atomic<std::uint64_t>*>(count);
  log::error("Vulkan's validation layer: {}", finding->pMessage);
  return VK_FALSE;
}

}  // namespace

/// Vulkan, opened, with what of it is not a device's.
struct GpuDevice::Instance {
  Library library;
  VulkanFunctions vk;
  VkInstance handle = VK_NULL_HANDLE;
  VkDebugUtilsMessengerEXT messenger = VK_NULL_HANDLE;
  std::shared_ptr<std::atomic<std::uint64_t>> findings = std::make_shared<std::atomic<std::uint64_t>>(0);
  std::vector<VkPhysicalDevice> devices;

  explicit Instance(bool validate);
  ~Instance() {
    if (messenger != VK_NULL_HANDLE) vk.DestroyDebugUtilsMessengerEXT(handle, messenger, nullptr);
    vk.DestroyInstance(handle, nullptr);
  }
  Instance(const Instance&) = delete;
  Instance& operator=(const Instance&) = delete;
};

GpuDevice::Instance::Instance(bool validate) {
  vk.GetInstanceProcAddr = library.entry();
  const auto version =
      reinterpret_cast<PFN_vkEnumerateInstanceVersion>(vk.GetInstanceProcAddr(nullptr, "vkEnumerateInstanceVersion"));
  std::uint32_t found = VK_API_VERSION_1_0;
  if (version != nullptr) version(&found);
  if (found < kVersion) {
    throw Error(ExitCode::NoDevice, "Vulkan is older than 1.2", "bring the system's libvulkan1 up to date");
  }
  const bool validates = validate && has_layer(vk.GetInstanceProcAddr, kValidationLayer);
  if (validate && !validates) {
    log::warning("Vulkan's validation layer is not there: apt-get install vulkan-validationlayers");
  }

  auto application = vulkan_structure<VkApplicationInfo>(VK_STRUCTURE_TYPE_APPLICATION_INFO);
  application.pApplicationName = "hpr";
  application.apiVersion = kVersion;
  auto wanted = vulkan_structure<VkInstanceCreateInfo>(VK_STRUCTURE_TYPE_INSTANCE_CREATE_INFO);
  wanted.pApplicationInfo = &application;
  constexpr std::array<const char*, 2> kExtensions{VK_EXT_DEBUG_UTILS_EXTENSION_NAME,
                                                   VK_EXT_VALIDATION_FEATURES_EXTENSION_NAME};
  const VkValidationFeatureEnableEXT order = VK_VALIDATION_FEATURE_ENABLE_SYNCHRONIZATION_VALIDATION_EXT;
  auto features = vulkan_structure<VkValidationFeaturesEXT>(VK_STRUCTURE_TYPE_VALIDATION_FEATURES_EXT);
  features.enabledValidationFeatureCount = 1;
  features.pEnabledValidationFeatures = &order;
  if (validates) {
    wanted.pNext = &features;
    wanted.enabledLayerCount = 1;
    wanted.ppEnabledLayerNames = &kValidationLayer;
    wanted.enabledExtensionCount = static_cast<std::uint32_t>(kExtensions.size());
    wanted.ppEnabledExtensionNames = kExtensions.data();
  }
  const auto create = reinterpret_cast<PFN_vkCreateInstance>(vk.GetInstanceProcAddr(nullptr, "vkCreateInstance"));
  const VkResult made = create(&wanted, nullptr, &handle);
  if (made != VK_SUCCESS) {
    throw Error(ExitCode::NoDevice, fmt::format("Vulkan does not start (VkResult {})", static_cast<int>(made)),
                std::string(kInstall));
  }
#define HPR_VULKAN_LOAD(name) vk.name = reinterpret_cast<PFN_vk##name>(vk.GetInstanceProcAddr(handle, "vk" #name));
  HPR_VULKAN_INSTANCE_FUNCTIONS(HPR_VULKAN_LOAD)
  if (validates) {
    HPR_VULKAN_LOAD(CreateDebugUtilsMessengerEXT)
    HPR_VULKAN_LOAD(DestroyDebugUtilsMessengerEXT)
  }
#undef HPR_VULKAN_LOAD
  if (validates) {
    auto to =
        vulkan_structure<VkDebugUtilsMessengerCreateInfoEXT>(VK_STRUCTURE_TYPE_DEBUG_UTILS_MESSENGER_CREATE_INFO_EXT);
    to.messageSeverity =
        VK_DEBUG_UTILS_MESSAGE_SEVERITY_ERROR_BIT_EXT | VK_DEBUG_UTILS_MESSAGE_SEVERITY_WARNING_BIT_EXT;
    to.messageType = VK_DEBUG_UTILS_MESSAGE_TYPE_VALIDATION_BIT_EXT;
    to.pfnUserCallback = note_finding;
    to.pUserData = findings.get();
    if (vk.CreateDebugUtilsMessengerEXT(handle, &to, nullptr, &messenger) != VK_SUCCESS) messenger = VK_NULL_HANDLE;
  }
  std::uint32_t count = 0;
  if (vk.EnumeratePhysicalDevices(handle, &count, nullptr) != VK_SUCCESS) count = 0;
  devices.resize(count);
  if (count > 0 && vk.EnumeratePhysicalDevices(handle, &count, devices.data()) < VK_SUCCESS) count = 0;
  devices.resize(count);
}

namespace {

struct Features {
  VkPhysicalDeviceFeatures2 base =
      vulkan_structure<VkPhysicalDeviceFeatures2>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_FEATURES_2);
  VkPhysicalDeviceVulkan12Features more =
      vulkan_structure<VkPhysicalDeviceVulkan12Features>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_VULKAN_1_2_FEATURES);
};

/// What hpr's kernels need: 64-bit keys, places in double, buffers by address, and semaphores that count.
struct Need {
  std::string_view name;
  VkBool32& (*of)(Features&);
};
constexpr std::array<Need, 5> kNeeds{
    {{"shaderInt64", [](Features& f) -> VkBool32& { return f.base.features.shaderInt64; }},
     {"shaderFloat64", [](Features& f) -> VkBool32& { return f.base.features.shaderFloat64; }},
     {"bufferDeviceAddress", [](Features& f) -> VkBool32& { return f.more.bufferDeviceAddress; }},
     {"timelineSemaphore", [](Features& f) -> VkBool32& { return f.more.timelineSemaphore; }},
     {"scalarBlockLayout", [](Features& f) -> VkBool32& { return f.more.scalarBlockLayout; }}}};

std::string missing_of(const VulkanFunctions& vk, VkPhysicalDevice device) {
  Features found;
  found.base.pNext = &found.more;
  vk.GetPhysicalDeviceFeatures2(device, &found.base);
  std::string missing;
  for (const Need& need : kNeeds) {
    if (need.of(found) == VK_TRUE) continue;
    missing += missing.empty() ? "" : ", ";
    missing += need.name;
  }
  return missing;
}

std::vector<VkQueueFamilyProperties> queue_families(const VulkanFunctions& vk, VkPhysicalDevice device) {
  std::uint32_t count = 0;
  vk.GetPhysicalDeviceQueueFamilyProperties(device, &count, nullptr);
  std::vector<VkQueueFamilyProperties> families(count);
  vk.GetPhysicalDeviceQueueFamilyProperties(device, &count, families.data());
  return families;
}

std::optional<std::uint32_t> computing_family(const std::vector<VkQueueFamilyProperties>& families) {
  for (std::uint32_t i = 0; i < families.size(); ++i) {
    if ((families[i].queueFlags & VK_QUEUE_COMPUTE_BIT) != 0) return i;
  }
  return std::nullopt;
}

GpuInfo info_of(const VulkanFunctions& vk, VkPhysicalDevice device, int index) {
  auto ids = vulkan_structure<VkPhysicalDeviceIDProperties>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_ID_PROPERTIES);
  auto driver = vulkan_structure<VkPhysicalDeviceDriverProperties>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_DRIVER_PROPERTIES);
  auto properties = vulkan_structure<VkPhysicalDeviceProperties2>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PROPERTIES_2);
  properties.pNext = &driver;
  driver.pNext = &ids;
  vk.GetPhysicalDeviceProperties2(device, &properties);
  GpuInfo info;
  info.index = index;
  info.name = properties.properties.deviceName;
  info.driver = driver.driverInfo;
  info.software = properties.properties.deviceType == VK_PHYSICAL_DEVICE_TYPE_CPU;
  info.discrete = properties.properties.deviceType == VK_PHYSICAL_DEVICE_TYPE_DISCRETE_GPU;
  std::ranges::copy(ids.deviceUUID, info.uuid.begin());
  VkPhysicalDeviceMemoryProperties memory{};
  vk.GetPhysicalDeviceMemoryProperties(device, &memory);
  for (std::uint32_t i = 0; i < memory.memoryHeapCount; ++i) {
    const VkMemoryHeap& heap = memory.memoryHeaps[i];
    if ((heap.flags & VK_MEMORY_HEAP_DEVICE_LOCAL_BIT) != 0) info.memory = std::max(info.memory, heap.size);
  }
  if (properties.properties.apiVersion < kVersion) {
    info.lacks = "Vulkan 1.2";
  } else if (!computing_family(queue_families(vk, device))) {
    info.lacks = "a queue that computes";
  } else {
    info.lacks = missing_of(vk, device);
  }
  return info;
}

std::vector<GpuInfo> infos_of(const VulkanFunctions& vk, const std::vector<VkPhysicalDevice>& devices) {
  std::vector<GpuInfo> infos;
  infos.reserve(devices.size());
  for (VkPhysicalDevice device : devices) infos.push_back(info_of(vk, device, static_cast<int>(infos.size())));
  return infos;
}

std::string list_of(const std::vector<GpuInfo>& gpus) {
  std::string list;
  for (const GpuInfo& gpu : gpus) {
    list += fmt::format("{}{}: {}{}", list.empty() ? "" : ", ", gpu.index, gpu.name,
                        gpu.lacks.empty() ? (gpu.software ? " (software)" : "") : " (lacks " + gpu.lacks + ")");
  }
  return list.empty() ? "none" : list;
}

/// In the order in which they are chosen.
enum class Kind { Card, Shared, Software };

Kind kind_of(const GpuInfo& gpu) {
  if (gpu.software) return Kind::Software;
  return gpu.discrete ? Kind::Card : Kind::Shared;
}

}  // namespace

std::vector<GpuInfo> find_gpus() {
  const GpuDevice::Instance instance(false);
  return infos_of(instance.vk, instance.devices);
}

GpuInfo choose_gpu(const std::vector<GpuInfo>& gpus, const GpuOptions& options) {
  if (options.device >= 0) {
    const auto at = static_cast<std::size_t>(options.device);
    if (at >= gpus.size()) {
      throw Error(ExitCode::Usage, fmt::format("there is no Vulkan device {}", options.device),
                  fmt::format("devices: {}", list_of(gpus)));
    }
    if (!gpus[at].lacks.empty()) {
      throw Error(ExitCode::NoDevice, fmt::format("Vulkan device {} ({}) lacks {}", at, gpus[at].name, gpus[at].lacks),
                  fmt::format("devices: {}", list_of(gpus)));
    }
    return gpus[at];
  }
  for (const Kind kind : {Kind::Card, Kind::Shared, Kind::Software}) {
    if (kind == Kind::Software && !options.software) continue;
    std::vector<const GpuInfo*> usable;
    for (const GpuInfo& gpu : gpus) {
      const bool is_new = std::ranges::none_of(usable, [&](const GpuInfo* other) { return other->uuid == gpu.uuid; });
      if (kind_of(gpu) == kind && gpu.lacks.empty() && is_new) usable.push_back(&gpu);
    }
    if (!usable.empty()) return *usable[static_cast<std::size_t>(options.local_rank) % usable.size()];
  }
  throw Error(ExitCode::NoDevice, fmt::format("no GPU that Vulkan can compute on; devices: {}", list_of(gpus)),
              "install the driver of the GPU, or leave the work to the CPU");
}

GpuDevice::GpuDevice(const GpuOptions& options)
    : GpuDevice(options, [&](const std::vector<GpuInfo>& gpus) { return choose_gpu(gpus, options); }) {}

GpuDevice::GpuDevice(const GpuOptions& options, const Choose& choose)
    : instance_(std::make_unique<Instance>(options.validate)), limit_(options.limit) {
  info_ = choose(infos_of(instance_->vk, instance_->devices));
  auto* const physical = instance_->devices[static_cast<std::size_t>(info_.index)];
  functions_ = std::make_unique<VulkanFunctions>(instance_->vk);
  vk_ = functions_.get();

  const std::vector<VkQueueFamilyProperties> families = queue_families(*vk_, physical);
  queue_family_ = computing_family(families).value();
  auto properties = vulkan_structure<VkPhysicalDeviceProperties2>(VK_STRUCTURE_TYPE_PHYSICAL_DEVICE_PROPERTIES_2);
  vk_->GetPhysicalDeviceProperties2(physical, &properties);
  const std::uint32_t bits = families[queue_family_].timestampValidBits;
  if (bits > 0) {
    timestamp_mask_ = bits >= 64 ? ~std::uint64_t{0} : (std::uint64_t{1} << bits) - 1;
    timestamp_ns_ = static_cast<double>(properties.properties.limits.timestampPeriod);
  }
  vk_->GetPhysicalDeviceMemoryProperties(physical, &memory_);

  const float priority = 1.0F;
  auto queue = vulkan_structure<VkDeviceQueueCreateInfo>(VK_STRUCTURE_TYPE_DEVICE_QUEUE_CREATE_INFO);
  queue.queueFamilyIndex = queue_family_;
  queue.queueCount = 1;
  queue.pQueuePriorities = &priority;
  Features needed;
  for (const Need& need : kNeeds) need.of(needed) = VK_TRUE;
  needed.base.pNext = &needed.more;
  auto wanted = vulkan_structure<VkDeviceCreateInfo>(VK_STRUCTURE_TYPE_DEVICE_CREATE_INFO);
  wanted.pNext = &needed.base;
  wanted.queueCreateInfoCount = 1;
  wanted.pQueueCreateInfos = &queue;
  const VkResult made = vk_->CreateDevice(physical, &wanted, nullptr, &device_);
  if (made != VK_SUCCESS) {
    throw Error(ExitCode::NoDevice,
                fmt::format("Vulkan device {} ({}) does not start (VkResult {})", info_.index, info_.name,
                            static_cast<int>(made)),
                "another program may hold all of its memory; hpr doctor lists the devices");
  }
#define HPR_VULKAN_LOAD(name) \
  functions_->name = reinterpret_cast<PFN_vk##name>(vk_->GetDeviceProcAddr(device_, "vk" #name));
  HPR_VULKAN_DEVICE_FUNCTIONS(HPR_VULKAN_LOAD)
#undef HPR_VULKAN_LOAD
  vk_->GetDeviceQueue(device_, queue_family_, 0, &queue_);
}

GpuDevice::~GpuDevice() {
  kernels_.clear();
  if (given_up_) {
    (void)instance_.release();
    (void)functions_.release();
    return;
  }
  if (device_ != VK_NULL_HANDLE) vk_->DestroyDevice(device_, nullptr);
}

const GpuKernel& GpuDevice::kernel(std::span<const std::uint32_t> spirv, std::size_t constants,
                                   std::uint32_t variant) const {
  std::unique_ptr<const GpuKernel>& kept = kernels_[{spirv.data(), variant}];
  if (!kept) kept = std::make_unique<GpuKernel>(*this, spirv, constants, variant);
  HPR_CHECK(kept->constants() == constants);
  return *kept;
}

std::shared_ptr<const std::atomic<std::uint64_t>> GpuDevice::validation_errors() const {
  return instance_->findings;
}

bool GpuDevice::validates() const {
  return instance_->messenger != VK_NULL_HANDLE;
}

int GpuDevice::memory_type(std::uint32_t types, VkMemoryPropertyFlags wanted) const {
  for (std::uint32_t i = 0; i < memory_.memoryTypeCount; ++i) {
    if ((types >> i & 1U) != 0 && (memory_.memoryTypes[i].propertyFlags & wanted) == wanted) return static_cast<int>(i);
  }
  return -1;
}

std::uint64_t GpuDevice::heap_bytes(int memory_type) const {
  return memory_.memoryHeaps[memory_.memoryTypes[memory_type].heapIndex].size;
}

void GpuDevice::check(VkResult result, std::string_view doing, int limits) const {
  if (result == VK_SUCCESS) return;
  const std::string who = fmt::format("Vulkan device {} ({})", info_.index, info_.name);
  switch (result) {
    case VK_ERROR_DEVICE_LOST:
      throw Error(ExitCode::NoDevice, fmt::format("{} was lost while {}", who, doing),
                  "see what the system's log says of it (dmesg); start again, or leave the work to the CPU");
    case VK_ERROR_OUT_OF_DEVICE_MEMORY:
    case VK_ERROR_OUT_OF_HOST_MEMORY:
    case VK_ERROR_TOO_MANY_OBJECTS:
      throw Error(ExitCode::Limit, fmt::format("{} has no memory left while {}", who, doing),
                  fmt::format("it has {} of its own: give it less, or end other programs that use it",
                              format_bytes(info_.memory)));
    case VK_TIMEOUT:
      throw Error(ExitCode::Hang,
                  fmt::format("{} has not answered for {} s while {}", who, (limits * limit_).count(), doing),
                  "see what the system's log says of it (dmesg)");
    default:
      throw Error(ExitCode::Internal, fmt::format("{}: VkResult {} while {}", who, static_cast<int>(result), doing));
  }
}

}  // namespace hpr
