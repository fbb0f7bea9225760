//! Compiles kernels as wgpu and Mesa's RADV do, without a GPU: `vrtm-gpu-model ENTRY FILE.wgsl ...` writes the driver's
//! statistics and its assembly to `FILE.asm`. RADV's null device compiles for the GPU that RADV_FORCE_FAMILY names.

use std::ffi::{CStr, CString};
use std::path::Path;

use ash::vk;

type Result<T> = std::result::Result<T, Box<dyn std::error::Error>>;

/// More bindings than any kernel has. The first is the uniform one.
const BINDINGS: u32 = 16;

fn main() -> Result<()> {
    let arguments: Vec<String> = std::env::args().skip(1).collect();
    // SAFETY: the handles below are used as Vulkan demands, by one thread; the process ends without destroying them.
    unsafe {
        let compiler = Compiler::new()?;
        for pair in arguments.chunks_exact(2) {
            let [entry, file] = pair else { continue };
            let text = std::fs::read_to_string(file)?;
            let code = spirv(&text, entry).map_err(|error| format!("{file}: {error}"))?;
            std::fs::write(Path::new(file).with_extension("asm"), compiler.assembly(&code, entry)?)?;
        }
    }
    Ok(())
}

/// SPIR-V with the checks that wgpu asks of naga on a device with robust access to buffers.
fn spirv(text: &str, entry: &str) -> std::result::Result<Vec<u32>, String> {
    use naga::back::spv;
    use naga::proc::{BoundsCheckPolicies, BoundsCheckPolicy};
    use naga::valid::{Capabilities, ValidationFlags, Validator};
    let module = naga::front::wgsl::parse_str(text).map_err(|error| error.emit_to_string(text))?;
    let info = Validator::new(ValidationFlags::all(), Capabilities::all()).validate(&module);
    let info = info.map_err(|error| error.emit_to_string(text))?;
    let options = spv::Options {
        lang_version: (1, 5),
        bounds_check_policies: BoundsCheckPolicies {
            index: BoundsCheckPolicy::Restrict,
            ..BoundsCheckPolicies::default()
        },
        zero_initialize_workgroup_memory: spv::ZeroInitializeWorkgroupMemoryMode::None,
        ..spv::Options::default()
    };
    let pipeline =
        spv::PipelineOptions { entry_point: entry.into(), shader_stage: naga::ShaderStage::Compute };
    spv::write_vec(&module, &info, &options, Some(&pipeline)).map_err(|error| error.to_string())
}

struct Compiler {
    device: ash::Device,
    layout: vk::PipelineLayout,
    executables: ash::khr::pipeline_executable_properties::Device,
    // Unloads Vulkan when it is dropped.
    _entry: ash::Entry,
}

impl Compiler {
    unsafe fn new() -> Result<Compiler> {
        unsafe {
            let entry = ash::Entry::load()?;
            let application = vk::ApplicationInfo::default().api_version(vk::API_VERSION_1_3);
            let info = vk::InstanceCreateInfo::default().application_info(&application);
            let instance = entry.create_instance(&info, None)?;
            let adapter = *instance.enumerate_physical_devices()?.first().ok_or("no Vulkan device")?;
            let queues = [vk::DeviceQueueCreateInfo::default().queue_priorities(&[1.0])];
            let extensions = [ash::khr::pipeline_executable_properties::NAME, ash::ext::robustness2::NAME];
            let extensions = extensions.map(CStr::as_ptr);
            let mut executable = vk::PhysicalDevicePipelineExecutablePropertiesFeaturesKHR::default()
                .pipeline_executable_info(true);
            let mut robust = vk::PhysicalDeviceRobustness2FeaturesEXT::default().robust_buffer_access2(true);
            let features = vk::PhysicalDeviceFeatures::default().robust_buffer_access(true);
            let info = vk::DeviceCreateInfo::default()
                .queue_create_infos(&queues)
                .enabled_extension_names(&extensions)
                .enabled_features(&features)
                .push_next(&mut executable)
                .push_next(&mut robust);
            let device = instance.create_device(adapter, &info, None)?;
            let bindings: Vec<_> = (0..BINDINGS)
                .map(|number| {
                    let uniform = vk::DescriptorType::UNIFORM_BUFFER_DYNAMIC;
                    vk::DescriptorSetLayoutBinding::default()
                        .binding(number)
                        .descriptor_type(if number == 0 {
                            uniform
                        } else {
                            vk::DescriptorType::STORAGE_BUFFER
                        })
                        .descriptor_count(1)
                        .stage_flags(vk::ShaderStageFlags::COMPUTE)
                })
                .collect();
            let info = vk::DescriptorSetLayoutCreateInfo::default().bindings(&bindings);
            let sets = [device.create_descriptor_set_layout(&info, None)?];
            let info = vk::PipelineLayoutCreateInfo::default().set_layouts(&sets);
            let layout = device.create_pipeline_layout(&info, None)?;
            let executables = ash::khr::pipeline_executable_properties::Device::new(&instance, &device);
            Ok(Compiler { device, layout, executables, _entry: entry })
        }
    }

    /// Lines `# NAME = VALUE` of the driver's statistics, and the assembly.
    unsafe fn assembly(&self, code: &[u32], entry: &str) -> Result<String> {
        unsafe {
            let info = vk::ShaderModuleCreateInfo::default().code(code);
            let module = self.device.create_shader_module(&info, None)?;
            let entry = CString::new(entry)?;
            let stage = vk::PipelineShaderStageCreateInfo::default()
                .stage(vk::ShaderStageFlags::COMPUTE)
                .module(module)
                .name(&entry);
            let capture = vk::PipelineCreateFlags::CAPTURE_STATISTICS_KHR
                | vk::PipelineCreateFlags::CAPTURE_INTERNAL_REPRESENTATIONS_KHR;
            let info =
                vk::ComputePipelineCreateInfo::default().flags(capture).stage(stage).layout(self.layout);
            let pipelines = self.device.create_compute_pipelines(vk::PipelineCache::null(), &[info], None);
            let pipeline = pipelines.map_err(|(_, error)| error)?[0];
            let info = vk::PipelineExecutableInfoKHR::default().pipeline(pipeline);
            let mut text = String::new();
            for statistic in self.executables.get_pipeline_executable_statistics(&info)? {
                let name = statistic.name_as_c_str()?.to_string_lossy();
                text += &format!("# {name} = {}\n", statistic.value.u64);
            }
            // The last representation is the assembly. Its size is asked first, then its bytes.
            let get = self.executables.fp().get_pipeline_executable_internal_representations_khr;
            let mut count = 0;
            get(self.device.handle(), &info, &mut count, std::ptr::null_mut()).result()?;
            let mut parts = vec![vk::PipelineExecutableInternalRepresentationKHR::default(); count as usize];
            get(self.device.handle(), &info, &mut count, parts.as_mut_ptr()).result()?;
            let mut bytes: Vec<Vec<u8>> = parts.iter().map(|part| vec![0; part.data_size]).collect();
            for (part, bytes) in parts.iter_mut().zip(&mut bytes) {
                part.p_data = bytes.as_mut_ptr().cast();
            }
            get(self.device.handle(), &info, &mut count, parts.as_mut_ptr()).result()?;
            self.device.destroy_pipeline(pipeline, None);
            self.device.destroy_shader_module(module, None);
            let assembly = bytes.last().ok_or("no assembly")?;
            Ok(text + &String::from_utf8_lossy(assembly).replace('\0', ""))
        }
    }
}
