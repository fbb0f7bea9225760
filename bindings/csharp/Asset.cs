// A mesh that is redirected, for C#: what most programs need of the C API in Vrtm.cs, with arrays in place of pointers.
using System;
using System.Collections.Generic;
using System.Runtime.InteropServices;
using System.Text;
using System.Threading;
using static Vrtm.Api;
#if UNITY_5_3_OR_NEWER
using MonoPInvokeCallbackAttribute = AOT.MonoPInvokeCallbackAttribute;
#endif

namespace Vrtm
{
    /// <summary>A call that failed: nothing was written, and the last good result is still there.</summary>
    public sealed class VrtmException : Exception
    {
        /// <summary>One of VRTM_ERROR_.</summary>
        public int Status { get; }

        internal VrtmException(int status, string message) : base(message)
        {
            Status = status;
        }
    }

#if !UNITY_5_3_OR_NEWER
    /// <summary>Marks functions that native code calls, for compilers ahead of time.</summary>
    [AttributeUsage(AttributeTargets.Method)]
    internal sealed class MonoPInvokeCallbackAttribute : Attribute
    {
        public MonoPInvokeCallbackAttribute(Type type)
        {
        }
    }
#endif

    /// <summary>Receives a line of the log, on any thread: its level, code and values, and its words. Exceptions that
    /// it throws are dropped.</summary>
    public delegate void Log(vrtm_log_entry entry, string message);

    /// <summary>One mesh with its maps and results, on a device of its own. One thread at a time may use it.</summary>
    public sealed unsafe class Asset : IDisposable
    {
        // The library calls this one function, which finds the asset's log by its number. It may do so after Dispose,
        // from a call that another thread has not ended. The delegate stands here so that it is never collected.
        private static readonly vrtm_log_fn Receiver = Receive;
        private static readonly Dictionary<long, Log> Logs = new Dictionary<long, Log>();
        private static long assets;

        private readonly long number = Interlocked.Increment(ref assets);
        private readonly int vertices;
        private vrtm_device device;
        private vrtm_asset asset;

        /// <summary>Reads a mesh at rest. All is copied.</summary>
        /// <param name="positions">Three numbers per vertex.</param>
        /// <param name="faceCounts">Corners of each face; null = triangles.</param>
        /// <param name="indices">Vertex of each corner.</param>
        /// <param name="uvs">Two numbers per UV, v pointing up.</param>
        /// <param name="uvIndices">UV of each corner; null = one UV per corner.</param>
        /// <param name="weldByPosition">Vertices at one place are one, as in meshes of games.</param>
        /// <param name="gpu">Take a GPU where there is one.</param>
        /// <param name="log">Receives warnings and facts; null = warnings go to the console's errors.</param>
        public Asset(float[] positions, uint[] faceCounts, uint[] indices, float[] uvs, uint[] uvIndices = null,
            bool weldByPosition = false, bool gpu = false, Log log = null)
        {
            if (positions == null || indices == null || uvs == null)
            {
                throw new ArgumentNullException(positions == null ? "positions" : indices == null ? "indices" : "uvs");
            }
            vertices = positions.Length / 3;
            try
            {
                var about = vrtm_device_desc.Init();
                about.backend = gpu ? VRTM_BACKEND_AUTO : VRTM_BACKEND_CPU;
                about.log = Marshal.GetFunctionPointerForDelegate(Receiver);
                about.log_user = (void*)number;
                lock (Logs)
                {
                    Logs[number] = log ?? Warn;
                }
                fixed (vrtm_device* made = &device)
                {
                    Check(vrtm_device_create(&about, made));
                }
                fixed (float* p = positions, t = uvs)
                fixed (uint* counts = faceCounts, corners = indices, uvCorners = uvIndices)
                fixed (vrtm_asset* made = &asset)
                {
                    vrtm_array points = Packed(p, positions.Length, 3, "positions");
                    vrtm_array texture = Packed(t, uvs.Length, 2, "uvs");
                    var mesh = vrtm_mesh_desc.Init();
                    mesh.positions = &points;
                    mesh.face_counts = counts;
                    mesh.face_count = (UIntPtr)(faceCounts?.Length ?? 0);
                    mesh.indices = corners;
                    mesh.index_count = (UIntPtr)indices.Length;
                    mesh.uvs = &texture;
                    mesh.uv_indices = uvCorners;
                    mesh.uv_index_count = (UIntPtr)(uvIndices?.Length ?? 0);
                    mesh.weld = weldByPosition ? VRTM_WELD_POSITION : VRTM_WELD_INDEX;
                    Check(vrtm_asset_create(device, &mesh, made));
                }
            }
            catch
            {
                Dispose();
                throw;
            }
        }

        /// <summary>Sets the rigidity of a tile (1001), 0 (elastic) to 255 (rigid), first row at v = 1.</summary>
        public void SetRigidity(uint udim, byte[] values, int width, int height)
        {
            CheckSize("values", values, 1, width, height);
            fixed (byte* data = values)
            {
                var image = vrtm_image.Init();
                image.data = data;
                image.format = VRTM_PIXEL_U8;
                image.width = (uint)width;
                image.height = (uint)height;
                Check(vrtm_tile_set_rigidity(Tile(udim), &image));
            }
        }

        /// <summary>Settings of a tile, to be changed and set again.</summary>
        public vrtm_tile_settings GetSettings(uint udim)
        {
            var settings = vrtm_tile_settings.Init();
            Check(vrtm_tile_get_settings(Tile(udim), &settings));
            return settings;
        }

        public void SetSettings(uint udim, vrtm_tile_settings settings)
        {
            Check(vrtm_tile_set_settings(Tile(udim), &settings));
        }

        /// <summary>Solves for a pose.</summary>
        /// <param name="positions">Three numbers per vertex.</param>
        /// <param name="draft">The quick quality, for poses that change each frame.</param>
        public void Solve(float[] positions, bool draft = false)
        {
            var options = vrtm_solve_options.Init();
            options.quality = draft ? VRTM_QUALITY_DRAFT : VRTM_QUALITY_NORMAL;
            Solve(positions, options);
        }

        /// <summary>Solves for a pose.</summary>
        public void Solve(float[] positions, vrtm_solve_options options)
        {
            if (positions == null || positions.Length != 3 * vertices)
            {
                throw new ArgumentException($"positions: {positions?.Length ?? 0} numbers for {vertices} vertices");
            }
            fixed (float* p = positions)
            {
                var points = Packed(p, positions.Length, 3, "positions");
                Check(vrtm_asset_solve(asset, &points, &options));
            }
        }

        /// <summary>Cancels the solve or the job that is under way, from any thread: it soon fails with
        /// VRTM_ERROR_CANCELLED, and the last good result stays. Returns at once.</summary>
        public void Cancel()
        {
            Check(vrtm_asset_cancel(asset));
        }

        /// <summary>Writes a tile's redirection minus the texel's own UV, the bits of two half floats per texel, first
        /// row at v = 0 as Unity's and OpenGL's textures have it: a texture of 16-bit floats.</summary>
        public void FetchDelta(uint udim, ushort[] halves, int width, int height)
        {
            CheckSize("halves", halves, 2, width, height);
            fixed (ushort* data = halves)
            {
                Fetch(udim, VRTM_FETCH_REDIRECTION_DELTA, data, VRTM_PIXEL_F16, VRTM_ORIGIN_BOTTOM, width, height);
            }
        }

        /// <summary>Writes a tile's redirection: the UV at which the texture is to be looked up, first row at
        /// v = 1.</summary>
        public void FetchRedirection(uint udim, float[] uvs, int width, int height)
        {
            CheckSize("uvs", uvs, 2, width, height);
            fixed (float* data = uvs)
            {
                Fetch(udim, VRTM_FETCH_REDIRECTION, data, VRTM_PIXEL_F32, VRTM_ORIGIN_TOP, width, height);
            }
        }

        /// <summary>Figures of a tile's last solve.</summary>
        public vrtm_tile_report Report(uint udim)
        {
            var report = vrtm_tile_report.Init();
            Check(vrtm_tile_get_report(Tile(udim), &report));
            return report;
        }

        /// <summary>Features that are worse than without vrtm, the worst first, if the solve measured.</summary>
        public vrtm_worst_feature[] WorstFeatures(uint udim)
        {
            uint count;
            var features = new vrtm_worst_feature[16];
            fixed (vrtm_worst_feature* data = features)
            {
                Check(vrtm_tile_get_worst_features(Tile(udim), data, (UIntPtr)features.Length, &count));
            }
            Array.Resize(ref features, (int)count);
            return features;
        }

        /// <summary>Frees the memory; the asset cannot be used after that.</summary>
        public void Dispose()
        {
            if (asset.id != 0)
            {
                vrtm_asset_destroy(asset);
                asset.id = 0;
            }
            if (device.id != 0)
            {
                vrtm_device_destroy(device);
                device.id = 0;
            }
            lock (Logs)
            {
                Logs.Remove(number);
            }
            GC.SuppressFinalize(this);
        }

        ~Asset()
        {
            Dispose();
        }

        private void Fetch(uint udim, int kind, void* data, int format, int origin, int width, int height)
        {
            var image = vrtm_image_out.Init();
            image.data = data;
            image.format = format;
            image.origin = origin;
            image.width = (uint)width;
            image.height = (uint)height;
            var fetch = vrtm_fetch.Init();
            fetch.tile = Tile(udim);
            fetch.kind = kind;
            fetch.image = &image;
            Check(vrtm_asset_fetch(&fetch, (UIntPtr)1));
        }

        private vrtm_tile Tile(uint udim)
        {
            vrtm_tile tile;
            var key = new vrtm_tile_key { udim = udim };
            Check(vrtm_asset_find_tile(asset, &key, &tile));
            return tile;
        }

        private static void CheckSize(string name, Array values, int channels, int width, int height)
        {
            if (values == null || width < 0 || height < 0 || values.Length != (long)channels * width * height)
            {
                var texels = $"{width} x {height} texels" + (channels == 1 ? "" : $" of {channels}");
                throw new ArgumentException($"{name}: {values?.Length ?? 0} values for {texels}");
            }
        }

        private static vrtm_array Packed(float* data, int length, int components, string name)
        {
            if (length % components != 0)
            {
                throw new ArgumentException($"{name}: {length} numbers are no multiple of {components}");
            }
            var array = vrtm_array.Init();
            array.data = data;
            array.count = (UIntPtr)(length / components);
            return array;
        }

        private static void Check(int status)
        {
            if (status != VRTM_OK)
            {
                throw new VrtmException(status, Utf8(vrtm_last_error()));
            }
        }

        private static void Warn(vrtm_log_entry entry, string message)
        {
            if (entry.level == VRTM_LOG_LEVEL_WARNING)
            {
                Console.Error.WriteLine("vrtm: " + message);
            }
        }

        [MonoPInvokeCallback(typeof(vrtm_log_fn))]
        private static void Receive(void* user, vrtm_log_entry* entry)
        {
            try
            {
                Log log;
                lock (Logs)
                {
                    Logs.TryGetValue((long)user, out log);
                }
                log?.Invoke(*entry, Utf8(entry->message));
            }
            catch
            {
                // It must not pass through the library.
            }
        }

        private static string Utf8(byte* text)
        {
            var length = 0;
            while (text[length] != 0)
            {
                length++;
            }
            return Encoding.UTF8.GetString(text, length);
        }
    }
}
