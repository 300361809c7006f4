//! A fault for tests: the n-th call of one kind fails, and a program shows on any device what it does then.
//!
//! A [`Fault`] stands between the program and the driver: functions of the driver that may fail are replaced
//! in the tables from which everybody takes them, the allocator and the swapchain too. So no other code
//! knows of faults, and a device without one calls its driver directly. A call that fails does not reach the
//! driver, hence the validation layers take only what was really made for a leak.

use std::collections::BTreeMap;
use std::ffi::{CStr, c_char};
use std::str::FromStr;
use std::sync::atomic::{AtomicBool, AtomicU64, Ordering};
use std::sync::{Arc, Mutex, OnceLock};

use ash::vk;
use ash::vk::Handle as _;

use super::lock;
use base::error::{Error, Kind};

/// A kind of calls of the driver.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Call {
    /// Allocations of device memory. With a fault of this kind each buffer and image has memory of its own, so
    /// that each of them is met.
    Memory,
    /// Creations and bindings of all other objects.
    Object,
    /// Submissions.
    Submit,
    /// Waits for the device, and questions how far it has come.
    Wait,
    /// Creations of swapchains.
    Swapchain,
    /// Acquisitions of a window's pictures.
    Acquire,
    /// Presentations of them.
    Present,
}

/// The way in which a call fails.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Failure {
    /// The device has no memory left.
    DeviceMemory,
    /// The host has no memory left.
    HostMemory,
    /// The device is lost: from then on all that a lost device refuses fails.
    Lost,
    /// The swapchain no longer fits its window.
    OutOfDate,
    /// The surface of the window is lost.
    SurfaceLost,
}

/// A call that fails, on whichever device it falls of those that were booted with this fault or a clone.
#[derive(Clone, Debug)]
pub struct Fault(Arc<Plan>);

#[derive(Debug)]
struct Plan {
    call: Call,
    nth: AtomicU64,
    failure: Failure,
    calls: AtomicU64,
}

impl Fault {
    /// Creates a fault of the `nth` call of a kind, counted from 1.
    pub fn new(call: Call, nth: u64, failure: Failure) -> Self {
        Fault(Arc::new(Plan { call, nth: AtomicU64::new(nth), failure, calls: AtomicU64::new(0) }))
    }

    /// Returns the fault that is `given`, or else that of the environment: `VGS_FAULT=CALL:N:FAILURE`, whose calls are
    /// counted from the start of the program.
    pub(super) fn in_force(given: Option<&Fault>) -> base::Result<Option<&Fault>> {
        static OF_ENVIRONMENT: OnceLock<Option<Result<Fault, String>>> = OnceLock::new();
        let of_environment = || std::env::var("VGS_FAULT").ok().map(|text| text.parse());
        match (given, OF_ENVIRONMENT.get_or_init(of_environment)) {
            (Some(fault), _) | (None, Some(Ok(fault))) => Ok(Some(fault)),
            (None, Some(Err(why))) => {
                Err(Error::new(Kind::Usage, "VGS-GPU-052", format!("VGS_FAULT: {why}"))
                    .help("correct or unset it"))
            }
            (None, None) => Ok(None),
        }
    }

    /// Counts from here anew: the `nth` call from now on fails. A device that was lost stays so.
    pub fn begin_anew(&self, nth: u64) {
        self.0.nth.store(nth, Ordering::Relaxed);
        self.0.calls.store(0, Ordering::Relaxed);
    }

    /// Returns the number of calls of its kind since its creation or [`Self::begin_anew`]. If it is less than
    /// the `nth`, nothing has failed.
    pub fn calls(&self) -> u64 {
        self.0.calls.load(Ordering::Relaxed)
    }

    /// Returns true if its calls are allocations of device memory.
    pub(super) fn meets_memory(&self) -> bool {
        self.0.call == Call::Memory
    }

    /// Places the fault between the program and a device that was just created, and returns the device as
    /// the program is to see it. Extensions that are loaded from `instance` see it alike.
    pub(super) fn install(
        &self,
        instance: &mut ash::Instance,
        device: &ash::Device,
        queue_family: u32,
    ) -> ash::Device {
        let functions = instance.fp_v1_0();
        let faulty = Arc::new(Faulty {
            plan: Arc::clone(&self.0),
            device: device.handle(),
            driver: functions.get_device_proc_addr,
            lost: AtomicBool::new(false),
        });
        // SAFETY: plain query on a live device; the family was asked for when the device was made.
        let queue = unsafe { device.get_device_queue(queue_family, 0) };
        lock(&FAULTY)
            .extend([device.handle().as_raw(), queue.as_raw()].map(|key| (key, Arc::clone(&faulty))));
        let functions = ash::InstanceFnV1_0 { get_device_proc_addr, ..functions.clone() };
        *instance = ash::Instance::from_parts_1_3(
            instance.handle(),
            functions,
            instance.fp_v1_1().clone(),
            instance.fp_v1_3().clone(),
        );
        // SAFETY: the device is one of this instance.
        unsafe { ash::Device::load(instance.fp_v1_0(), device.handle()) }
    }
}

/// Parses `CALL:N:FAILURE`, such as `submit:3:lost`.
impl FromStr for Fault {
    type Err = String;

    fn from_str(text: &str) -> Result<Self, String> {
        let words: Vec<_> = text.split(':').collect();
        let &[call, nth, failure] = words.as_slice() else {
            return Err("a call, its number and a failure are needed, as submit:3:lost".into());
        };
        let call = match call {
            "memory" => Call::Memory,
            "object" => Call::Object,
            "submit" => Call::Submit,
            "wait" => Call::Wait,
            "swapchain" => Call::Swapchain,
            "acquire" => Call::Acquire,
            "present" => Call::Present,
            _ => return Err("calls: memory, object, submit, wait, swapchain, acquire, present".into()),
        };
        let failure = match failure {
            "device-memory" => Failure::DeviceMemory,
            "host-memory" => Failure::HostMemory,
            "lost" => Failure::Lost,
            "out-of-date" => Failure::OutOfDate,
            "surface-lost" => Failure::SurfaceLost,
            _ => return Err("failures: device-memory, host-memory, lost, out-of-date, surface-lost".into()),
        };
        let nth = nth.parse().map_err(|_| "the number of the call, counted from 1, is needed")?;
        Ok(Fault::new(call, nth, failure))
    }
}

/// Devices with a fault, by the handles of the device and of its queue.
static FAULTY: Mutex<BTreeMap<u64, Arc<Faulty>>> = Mutex::new(BTreeMap::new());

/// A device with a fault.
struct Faulty {
    plan: Arc<Plan>,
    device: vk::Device,
    /// What the driver's functions are asked of.
    driver: vk::PFN_vkGetDeviceProcAddr,
    lost: AtomicBool,
}

impl Faulty {
    /// Returns the device of a handle of a device or a queue.
    fn of(handle: impl vk::Handle) -> Arc<Self> {
        let found = lock(&FAULTY).get(&handle.as_raw()).cloned();
        found.expect("functions with a fault are given for devices in the table only")
    }

    /// Counts a call. Returns the result with which it fails, if it does.
    fn fails(&self, call: Call) -> Option<vk::Result> {
        let can_be_lost = matches!(call, Call::Submit | Call::Wait | Call::Acquire | Call::Present);
        let plan = &*self.plan;
        let is_nth = call == plan.call
            && plan.calls.fetch_add(1, Ordering::Relaxed) + 1 == plan.nth.load(Ordering::Relaxed);
        if is_nth && plan.failure == Failure::Lost {
            self.lost.store(true, Ordering::Relaxed);
        }
        if is_nth {
            return Some(match plan.failure {
                Failure::DeviceMemory => vk::Result::ERROR_OUT_OF_DEVICE_MEMORY,
                Failure::HostMemory => vk::Result::ERROR_OUT_OF_HOST_MEMORY,
                Failure::Lost => vk::Result::ERROR_DEVICE_LOST,
                Failure::OutOfDate => vk::Result::ERROR_OUT_OF_DATE_KHR,
                Failure::SurfaceLost => vk::Result::ERROR_SURFACE_LOST_KHR,
            });
        }
        (can_be_lost && self.lost.load(Ordering::Relaxed)).then_some(vk::Result::ERROR_DEVICE_LOST)
    }

    /// Returns a function of the driver.
    fn driver(&self, name: &CStr) -> vk::PFN_vkVoidFunction {
        // SAFETY: the device lives as long as its functions are called.
        unsafe { (self.driver)(self.device, name.as_ptr()) }
    }
}

/// Gives the functions of a device as vkGetDeviceProcAddr does; with a fault where one can be.
unsafe extern "system" fn get_device_proc_addr(
    device: vk::Device,
    name: *const c_char,
) -> vk::PFN_vkVoidFunction {
    // SAFETY: as Vulkan demands of the caller.
    let name = unsafe { CStr::from_ptr(name) };
    let driver = Faulty::of(device).driver(name)?;
    Some(with_fault(name).unwrap_or(driver))
}

/// Defines the functions that stand in for the driver's: kind of call, name, type, and arguments. Where the
/// driver leaves nulls behind after a failure, they follow.
macro_rules! functions {
    ($(
        $call:ident $name:literal $kind:ident
        ($first:ident: $first_type:ty $(, $argument:ident: $type:ty)*) $(nulls $nulls:ident $count:ident)?;
    )*) => {
        /// Returns the function that stands in for one of the driver's, if there is one.
        fn with_fault(name: &CStr) -> Option<unsafe extern "system" fn()> {
            $(if name == $name {
                unsafe extern "system" fn faulty($first: $first_type $(, $argument: $type)*) -> vk::Result {
                    let device = Faulty::of($first);
                    if let Some(failed) = device.fails(Call::$call) {
                        // SAFETY: the caller has room for so many handles, of which null is one.
                        $(unsafe { $nulls.write_bytes(0, $count as usize) };)?
                        return failed;
                    }
                    // SAFETY: Vulkan gives a function of this name the type that belongs to it, or null, which
                    // is the None of this type. The caller answers for the arguments.
                    unsafe {
                        let driver: Option<vk::$kind> = std::mem::transmute(device.driver($name));
                        driver.expect("it was there when the device was made")($first $(, $argument)*)
                    }
                }
                let function: vk::$kind = faulty;
                // SAFETY: a function pointer of another type, which is what callers make of it again.
                return Some(unsafe { std::mem::transmute::<vk::$kind, unsafe extern "system" fn()>(function) });
            })*
            if name == c"vkDestroyDevice" {
                let function: vk::PFN_vkDestroyDevice = destroy_device;
                // SAFETY: as above.
                return Some(unsafe {
                    std::mem::transmute::<vk::PFN_vkDestroyDevice, unsafe extern "system" fn()>(function)
                });
            }
            None
        }
    };
}

type Allocator<'a> = *const vk::AllocationCallbacks<'a>;

functions! {
    Memory c"vkAllocateMemory" PFN_vkAllocateMemory
        (d: vk::Device, info: *const vk::MemoryAllocateInfo<'_>, a: Allocator<'_>, made: *mut vk::DeviceMemory);
    Object c"vkMapMemory" PFN_vkMapMemory
        (d: vk::Device, memory: vk::DeviceMemory, offset: u64, size: u64, flags: vk::MemoryMapFlags,
         mapped: *mut *mut std::ffi::c_void);
    Object c"vkCreateBuffer" PFN_vkCreateBuffer
        (d: vk::Device, info: *const vk::BufferCreateInfo<'_>, a: Allocator<'_>, made: *mut vk::Buffer);
    Object c"vkBindBufferMemory" PFN_vkBindBufferMemory
        (d: vk::Device, buffer: vk::Buffer, memory: vk::DeviceMemory, offset: u64);
    Object c"vkCreateImage" PFN_vkCreateImage
        (d: vk::Device, info: *const vk::ImageCreateInfo<'_>, a: Allocator<'_>, made: *mut vk::Image);
    Object c"vkBindImageMemory" PFN_vkBindImageMemory
        (d: vk::Device, image: vk::Image, memory: vk::DeviceMemory, offset: u64);
    Object c"vkCreateImageView" PFN_vkCreateImageView
        (d: vk::Device, info: *const vk::ImageViewCreateInfo<'_>, a: Allocator<'_>, made: *mut vk::ImageView);
    Object c"vkCreateSampler" PFN_vkCreateSampler
        (d: vk::Device, info: *const vk::SamplerCreateInfo<'_>, a: Allocator<'_>, made: *mut vk::Sampler);
    Object c"vkCreateSemaphore" PFN_vkCreateSemaphore
        (d: vk::Device, info: *const vk::SemaphoreCreateInfo<'_>, a: Allocator<'_>, made: *mut vk::Semaphore);
    Object c"vkCreateQueryPool" PFN_vkCreateQueryPool
        (d: vk::Device, info: *const vk::QueryPoolCreateInfo<'_>, a: Allocator<'_>, made: *mut vk::QueryPool);
    Object c"vkCreateCommandPool" PFN_vkCreateCommandPool
        (d: vk::Device, info: *const vk::CommandPoolCreateInfo<'_>, a: Allocator<'_>, made: *mut vk::CommandPool);
    Object c"vkResetCommandPool" PFN_vkResetCommandPool
        (d: vk::Device, pool: vk::CommandPool, flags: vk::CommandPoolResetFlags);
    Object c"vkAllocateCommandBuffers" PFN_vkAllocateCommandBuffers
        (d: vk::Device, info: *const vk::CommandBufferAllocateInfo<'_>, made: *mut vk::CommandBuffer);
    Object c"vkCreateDescriptorPool" PFN_vkCreateDescriptorPool
        (d: vk::Device, info: *const vk::DescriptorPoolCreateInfo<'_>, a: Allocator<'_>,
         made: *mut vk::DescriptorPool);
    Object c"vkAllocateDescriptorSets" PFN_vkAllocateDescriptorSets
        (d: vk::Device, info: *const vk::DescriptorSetAllocateInfo<'_>, made: *mut vk::DescriptorSet);
    Object c"vkCreateDescriptorSetLayout" PFN_vkCreateDescriptorSetLayout
        (d: vk::Device, info: *const vk::DescriptorSetLayoutCreateInfo<'_>, a: Allocator<'_>,
         made: *mut vk::DescriptorSetLayout);
    Object c"vkCreatePipelineLayout" PFN_vkCreatePipelineLayout
        (d: vk::Device, info: *const vk::PipelineLayoutCreateInfo<'_>, a: Allocator<'_>,
         made: *mut vk::PipelineLayout);
    Object c"vkCreatePipelineCache" PFN_vkCreatePipelineCache
        (d: vk::Device, info: *const vk::PipelineCacheCreateInfo<'_>, a: Allocator<'_>,
         made: *mut vk::PipelineCache);
    Object c"vkCreateShaderModule" PFN_vkCreateShaderModule
        (d: vk::Device, info: *const vk::ShaderModuleCreateInfo<'_>, a: Allocator<'_>,
         made: *mut vk::ShaderModule);
    Object c"vkCreateComputePipelines" PFN_vkCreateComputePipelines
        (d: vk::Device, cache: vk::PipelineCache, count: u32, info: *const vk::ComputePipelineCreateInfo<'_>,
         a: Allocator<'_>, made: *mut vk::Pipeline) nulls made count;
    Object c"vkCreateGraphicsPipelines" PFN_vkCreateGraphicsPipelines
        (d: vk::Device, cache: vk::PipelineCache, count: u32, info: *const vk::GraphicsPipelineCreateInfo<'_>,
         a: Allocator<'_>, made: *mut vk::Pipeline) nulls made count;
    Submit c"vkQueueSubmit2" PFN_vkQueueSubmit2
        (queue: vk::Queue, count: u32, info: *const vk::SubmitInfo2<'_>, fence: vk::Fence);
    Wait c"vkWaitSemaphores" PFN_vkWaitSemaphores
        (d: vk::Device, info: *const vk::SemaphoreWaitInfo<'_>, timeout: u64);
    Wait c"vkGetSemaphoreCounterValue" PFN_vkGetSemaphoreCounterValue
        (d: vk::Device, semaphore: vk::Semaphore, value: *mut u64);
    Swapchain c"vkCreateSwapchainKHR" PFN_vkCreateSwapchainKHR
        (d: vk::Device, info: *const vk::SwapchainCreateInfoKHR<'_>, a: Allocator<'_>,
         made: *mut vk::SwapchainKHR);
    Acquire c"vkAcquireNextImageKHR" PFN_vkAcquireNextImageKHR
        (d: vk::Device, chain: vk::SwapchainKHR, timeout: u64, semaphore: vk::Semaphore, fence: vk::Fence,
         index: *mut u32);
    Present c"vkQueuePresentKHR" PFN_vkQueuePresentKHR
        (queue: vk::Queue, info: *const vk::PresentInfoKHR<'_>);
}

/// Destroys a device and takes it out of the table.
unsafe extern "system" fn destroy_device(device: vk::Device, allocator: Allocator<'_>) {
    let faulty = Faulty::of(device);
    lock(&FAULTY).retain(|_, entry| entry.device != device);
    // SAFETY: as in the functions above.
    unsafe {
        let driver: Option<vk::PFN_vkDestroyDevice> = std::mem::transmute(faulty.driver(c"vkDestroyDevice"));
        driver.expect("every device can be destroyed")(device, allocator);
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn faults_are_read_from_text() {
        let fault: Fault = "submit:3:lost".parse().unwrap();
        let Plan { call, nth, failure, .. } = &*fault.0;
        let nth = nth.load(Ordering::Relaxed);
        assert_eq!((*call, nth, *failure, fault.calls()), (Call::Submit, 3, Failure::Lost, 0));
        for (wrong, told) in [
            ("submit:3", "submit:3:lost"),
            ("send:3:lost", "calls: memory"),
            ("submit:x:lost", "counted from 1"),
            ("submit:3:gone", "failures: device-memory"),
        ] {
            assert!(wrong.parse::<Fault>().unwrap_err().contains(told), "{wrong}");
        }
    }
}
