//! A program that has a Vulkan device of its own, as hosts have: it knows nothing of vrtm but the UUID.

use std::ffi::CStr;

use ash::{Device, Entry, Instance, khr, vk};

/// Vulkan's own account of a GPU.
pub struct Gpu {
    pub name: String,
    pub uuid: [u8; 16],
    pub driver_uuid: [u8; 16],
    pub luid: Option<[u8; 8]>,
    pub vendor: u32,
    pub device: u32,
}

/// The host's device.
pub struct Host {
    /// Holds the library of Vulkan.
    _entry: Entry,
    instance: Instance,
    physical: vk::PhysicalDevice,
    device: Device,
    queue: vk::Queue,
    pool: vk::CommandPool,
    fds: khr::external_memory_fd::Device,
}

/// Memory of the host's device that other programs can import, and a buffer on it.
pub struct Shared<'a> {
    host: &'a Host,
    buffer: vk::Buffer,
    memory: vk::DeviceMemory,
    pub memory_size: u64,
    pub memory_type: u32,
    size: u64,
}

fn instance() -> (Entry, Instance) {
    // SAFETY: the library of Vulkan is loaded; the structs live.
    unsafe {
        let entry = Entry::load().expect("Vulkan's library");
        let application = vk::ApplicationInfo::default().api_version(vk::API_VERSION_1_1);
        let info = vk::InstanceCreateInfo::default().application_info(&application);
        let instance = entry.create_instance(&info, None).expect("an instance");
        (entry, instance)
    }
}

unsafe fn describe(instance: &Instance, physical: vk::PhysicalDevice) -> Gpu {
    let mut ids = vk::PhysicalDeviceIDProperties::default();
    let mut all = vk::PhysicalDeviceProperties2::default().push_next(&mut ids);
    // SAFETY: both are version 1.1 or later.
    unsafe { instance.get_physical_device_properties2(physical, &mut all) };
    let of = all.properties;
    Gpu {
        name: of.device_name_as_c_str().unwrap_or(c"").to_string_lossy().into_owned(),
        uuid: ids.device_uuid,
        driver_uuid: ids.driver_uuid,
        luid: (ids.device_luid_valid == vk::TRUE).then_some(ids.device_luid),
        vendor: of.vendor_id,
        device: of.device_id,
    }
}

/// All GPUs with Vulkan 1.1.
pub fn gpus() -> Vec<Gpu> {
    let (_entry, instance) = instance();
    // SAFETY: the instance lives until the end.
    unsafe {
        let all = instance.enumerate_physical_devices().unwrap();
        let gpus = all.iter().map(|&physical| describe(&instance, physical)).collect();
        instance.destroy_instance(None);
        gpus
    }
}

impl Host {
    /// A device on the GPU with this UUID; `None` if its driver does not export memory as file descriptors.
    pub fn open(uuid: [u8; 16]) -> Option<Host> {
        let (entry, instance) = instance();
        // SAFETY: what is used lives, and the extension is asked for only if it is there.
        unsafe {
            let all = instance.enumerate_physical_devices().unwrap();
            let mut same = all.into_iter().filter(|&physical| describe(&instance, physical).uuid == uuid);
            let physical = same.next().expect("a GPU with this UUID");
            let extensions = instance.enumerate_device_extension_properties(physical).unwrap();
            let name: &CStr = khr::external_memory_fd::NAME;
            if !extensions.iter().any(|extension| extension.extension_name_as_c_str() == Ok(name)) {
                instance.destroy_instance(None);
                return None;
            }
            let family = instance
                .get_physical_device_queue_family_properties(physical)
                .iter()
                .position(|family| family.queue_flags.contains(vk::QueueFlags::COMPUTE))
                .expect("a queue") as u32;
            let queues =
                [vk::DeviceQueueCreateInfo::default().queue_family_index(family).queue_priorities(&[1.0])];
            let names = [name.as_ptr()];
            let info =
                vk::DeviceCreateInfo::default().queue_create_infos(&queues).enabled_extension_names(&names);
            let device = instance.create_device(physical, &info, None).expect("a device");
            let queue = device.get_device_queue(family, 0);
            let pool = vk::CommandPoolCreateInfo::default().queue_family_index(family);
            let pool = device.create_command_pool(&pool, None).unwrap();
            let fds = khr::external_memory_fd::Device::new(&instance, &device);
            Some(Host { _entry: entry, instance, physical, device, queue, pool, fds })
        }
    }

    /// Runs commands and waits for them.
    fn run(&self, record: impl FnOnce(vk::CommandBuffer)) {
        // SAFETY: the commands are used by this thread alone, and are done when they are freed.
        unsafe {
            let info =
                vk::CommandBufferAllocateInfo::default().command_pool(self.pool).command_buffer_count(1);
            let commands = self.device.allocate_command_buffers(&info).unwrap();
            self.device.begin_command_buffer(commands[0], &vk::CommandBufferBeginInfo::default()).unwrap();
            record(commands[0]);
            self.device.end_command_buffer(commands[0]).unwrap();
            let submit = vk::SubmitInfo::default().command_buffers(&commands);
            self.device.queue_submit(self.queue, &[submit], vk::Fence::null()).unwrap();
            self.device.queue_wait_idle(self.queue).unwrap();
            self.device.free_command_buffers(self.pool, &commands);
        }
    }

    /// A buffer and its memory, of a type with all of `flags`.
    fn buffer(
        &self,
        size: u64,
        flags: vk::MemoryPropertyFlags,
        exported: bool,
    ) -> (vk::Buffer, vk::DeviceMemory, u64, u32) {
        let types = vk::ExternalMemoryHandleTypeFlags::OPAQUE_FD;
        // SAFETY: the structs live, and the buffer is unused when it is bound.
        unsafe {
            let mut external = vk::ExternalMemoryBufferCreateInfo::default().handle_types(types);
            let usage = vk::BufferUsageFlags::TRANSFER_SRC | vk::BufferUsageFlags::TRANSFER_DST;
            let info = vk::BufferCreateInfo::default().size(size).usage(usage);
            let info = if exported { info.push_next(&mut external) } else { info };
            let buffer = self.device.create_buffer(&info, None).unwrap();
            let needs = self.device.get_buffer_memory_requirements(buffer);
            let all = self.instance.get_physical_device_memory_properties(self.physical);
            let memory_type = (0..all.memory_type_count)
                .find(|&k| {
                    needs.memory_type_bits & (1 << k) != 0
                        && all.memory_types[k as usize].property_flags.contains(flags)
                })
                .expect("a memory type");
            let mut export = vk::ExportMemoryAllocateInfo::default().handle_types(types);
            let info =
                vk::MemoryAllocateInfo::default().allocation_size(needs.size).memory_type_index(memory_type);
            let info = if exported { info.push_next(&mut export) } else { info };
            let memory = self.device.allocate_memory(&info, None).unwrap();
            self.device.bind_buffer_memory(buffer, memory, 0).unwrap();
            (buffer, memory, needs.size, memory_type)
        }
    }

    /// Memory of at least `size` bytes, to be handed to others.
    pub fn share(&self, size: u64) -> Shared<'_> {
        let (buffer, memory, memory_size, memory_type) =
            self.buffer(size, vk::MemoryPropertyFlags::DEVICE_LOCAL, true);
        Shared { host: self, buffer, memory, memory_size, memory_type, size }
    }
}

impl Shared<'_> {
    /// A file descriptor of the memory, the caller's to close.
    pub fn descriptor(&self) -> i32 {
        let info = vk::MemoryGetFdInfoKHR::default()
            .memory(self.memory)
            .handle_type(vk::ExternalMemoryHandleTypeFlags::OPAQUE_FD);
        // SAFETY: the memory lives and was allocated for this.
        unsafe { self.host.fds.get_memory_fd(&info).unwrap() }
    }

    /// Sets all bytes, with this device.
    pub fn fill(&self, byte: u8) {
        self.host.run(|commands| {
            let word = u32::from_ne_bytes([byte; 4]);
            // SAFETY: the buffer lives until the commands are done.
            unsafe { self.host.device.cmd_fill_buffer(commands, self.buffer, 0, vk::WHOLE_SIZE, word) };
        });
    }

    /// All bytes, as this device has them.
    pub fn read(&self) -> Vec<u8> {
        let host = self.host;
        let flags = vk::MemoryPropertyFlags::HOST_VISIBLE | vk::MemoryPropertyFlags::HOST_COHERENT;
        let (staging, memory, ..) = host.buffer(self.size, flags, false);
        host.run(|commands| {
            let barrier = [vk::BufferMemoryBarrier::default()
                .buffer(self.buffer)
                .size(vk::WHOLE_SIZE)
                .src_queue_family_index(vk::QUEUE_FAMILY_EXTERNAL)
                .dst_queue_family_index(0)
                .dst_access_mask(vk::AccessFlags::TRANSFER_READ)];
            use vk::PipelineStageFlags as Stage;
            let (from, to, none) = (Stage::TOP_OF_PIPE, Stage::TRANSFER, vk::DependencyFlags::empty());
            let copy = [vk::BufferCopy::default().size(self.size)];
            // SAFETY: both buffers live until the commands are done.
            unsafe {
                host.device.cmd_pipeline_barrier(commands, from, to, none, &[], &barrier, &[]);
                host.device.cmd_copy_buffer(commands, self.buffer, staging, &copy);
            }
        });
        // SAFETY: the memory is mapped while it is read, and nothing uses it afterwards.
        unsafe {
            let flags = vk::MemoryMapFlags::empty();
            let from = host.device.map_memory(memory, 0, vk::WHOLE_SIZE, flags).unwrap();
            let bytes = std::slice::from_raw_parts(from.cast::<u8>(), self.size as usize).to_vec();
            host.device.destroy_buffer(staging, None);
            host.device.free_memory(memory, None);
            bytes
        }
    }
}

impl Drop for Shared<'_> {
    fn drop(&mut self) {
        // SAFETY: no commands use them any more.
        unsafe {
            self.host.device.destroy_buffer(self.buffer, None);
            self.host.device.free_memory(self.memory, None);
        }
    }
}

impl Drop for Host {
    fn drop(&mut self) {
        // SAFETY: the device is idle, and what was made on it is gone.
        unsafe {
            self.device.destroy_command_pool(self.pool, None);
            self.device.destroy_device(None);
            self.instance.destroy_instance(None);
        }
    }
}
