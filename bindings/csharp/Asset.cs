// A mesh that is redirected, for C#: what most programs need of the C API in Vrtm.cs, with arrays in place of pointers.
// The rest of it takes Asset.Handle and Asset.Tile, and Asset.Check throws where a call has failed.
using System;
using System.Collections.Generic;
using System.Runtime.CompilerServices;
using System.Runtime.InteropServices;
using System.Text;
using System.Threading;
using System.Threading.Tasks;
using static Vrtm.Api;

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

    /// <summary>Receives a line of the log, on any thread: its level, code and values, and its words. Exceptions that
    /// it throws are dropped.</summary>
    public delegate void Log(vrtm_log_entry entry, string message);

    /// <summary>One map to be fetched from a tile.</summary>
    public struct Map
    {
        /// <summary>The tile.</summary>
        public uint Udim;
        /// <summary>One of VRTM_FETCH_ but CARRIED.</summary>
        public int Kind;
        /// <summary>Length(Kind, Width, Height) numbers: float[], or ushort[] for the bits of half floats.</summary>
        public Array Values;
        /// <summary>Texels in u and in v.</summary>
        public int Width, Height;
        /// <summary>First row at v = 0, as in Unity's and OpenGL's textures, in place of v = 1.</summary>
        public bool FromBottom;
        /// <summary>For VRTM_FETCH_UV_SET and its delta: the UV set that the values are UVs of.</summary>
        public uint UvSet;

        /// <summary>Numbers for each texel.</summary>
        public static int Channels(int kind) =>
            kind == VRTM_FETCH_JACOBIAN ? 4 : kind == VRTM_FETCH_FILTER_SCALE ? 1 : 2;

        /// <summary>Numbers of a map: the size of its array.</summary>
        public static long Length(int kind, int width, int height) => (long)Channels(kind) * width * height;
    }

    /// <summary>One solve that runs beside the program's own work. Any thread may use it. `await job` waits for its
    /// end, as Wait does.</summary>
    public sealed class Job : IDisposable
    {
        private readonly Asset asset; // That it is not collected before.
        private readonly vrtm_job job;
        private int destroyed;

        internal Job(Asset asset, vrtm_job job)
        {
            this.asset = asset;
            this.job = job;
        }

        /// <summary>State, status, fraction of the work that is done, and time.</summary>
        public unsafe vrtm_job_progress Progress
        {
            get
            {
                var progress = vrtm_job_progress.Init();
                Asset.Check(vrtm_job_get_progress(job, &progress));
                return progress;
            }
        }

        /// <summary>Cancels it and returns at once: it ends soon after with VRTM_ERROR_CANCELLED, unless it already has
        /// its result.</summary>
        public void Cancel() => Asset.Check(vrtm_job_cancel(job));

        /// <summary>Waits for its end, and throws what the solve would have thrown. False: the time was too
        /// short.</summary>
        public bool Wait(uint milliseconds = VRTM_FOREVER)
        {
            var status = vrtm_job_wait(job, milliseconds);
            if (status != VRTM_ERROR_TIMEOUT)
            {
                Asset.Check(status);
            }
            GC.KeepAlive(this);
            return status == VRTM_OK;
        }

        /// <summary>A task that ends with the job, and fails as Wait does. The token cancels the job.</summary>
        public async Task WaitAsync(CancellationToken cancel = default(CancellationToken))
        {
            using (cancel.Register(Cancel))
            {
                await Task.Run(() => Wait()).ConfigureAwait(false);
            }
        }

        public TaskAwaiter GetAwaiter() => WaitAsync().GetAwaiter();

        /// <summary>Cancels it unless it is done, and waits for its end: the asset can then be used.</summary>
        public void Dispose()
        {
            if (Interlocked.Exchange(ref destroyed, 1) == 0)
            {
                vrtm_job_destroy(job);
            }
            GC.KeepAlive(asset);
            GC.SuppressFinalize(this);
        }

        ~Job()
        {
            Dispose();
        }
    }

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
        private readonly Map[] one = new Map[1];
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

        public void SetSettings(uint udim, vrtm_tile_settings settings) =>
            Check(vrtm_tile_set_settings(Tile(udim), &settings));

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
        public void Solve(float[] positions, vrtm_solve_options options) => Redirect(positions, options);

        /// <summary>Solves for a pose and fetches maps, in one call.</summary>
        public void Redirect(float[] positions, vrtm_solve_options options, params Map[] maps)
        {
            CheckPose(positions);
            fixed (float* p = positions)
            {
                var points = Packed(p, positions.Length, 3, "positions");
                Run(&points, &options, maps);
            }
        }

        /// <summary>Fetches maps, all of the same last solve, also while another one is under way.</summary>
        public void Fetch(params Map[] maps) => Run(null, null, maps);

        /// <summary>Begins to solve for a pose, and returns at once. Until the job has ended, other calls that solve or
        /// change the asset fail with VRTM_ERROR_BUSY. With `options.replace` 1 the newest pose wins: a job or a solve
        /// that is under way is cancelled, and this call waits for its end.</summary>
        public Job Submit(float[] positions, vrtm_solve_options options)
        {
            CheckPose(positions);
            fixed (float* p = positions)
            {
                vrtm_job job;
                var points = Packed(p, positions.Length, 3, "positions");
                Check(vrtm_asset_submit(asset, &points, &options, &job));
                return new Job(this, job);
            }
        }

        /// <summary>Cancels the solve or the job that is under way, from any thread: it soon fails with
        /// VRTM_ERROR_CANCELLED, and the last good result stays. Returns at once.</summary>
        public void Cancel() => Check(vrtm_asset_cancel(asset));

        /// <summary>Writes a tile's redirection minus the texel's own UV, the bits of two half floats per texel, first
        /// row at v = 0 as Unity's and OpenGL's textures have it: a texture of 16-bit floats.</summary>
        public void FetchDelta(uint udim, ushort[] halves, int width, int height) =>
            FetchOne("halves", udim, VRTM_FETCH_REDIRECTION_DELTA, halves, width, height, true);

        /// <summary>Writes a tile's redirection: the UV at which the texture is to be looked up, first row at
        /// v = 1.</summary>
        public void FetchRedirection(uint udim, float[] uvs, int width, int height) =>
            FetchOne("uvs", udim, VRTM_FETCH_REDIRECTION, uvs, width, height, false);

        /// <summary>Writes the redirected UV of every corner of the mesh, two numbers each, for programs that set UVs
        /// instead of reading a map. Info.corners is their number.</summary>
        public void FetchCornerUvs(float[] uvs, uint uvSet = 0)
        {
            CheckSize("uvs", uvs, 2, (int)Info.corners, 1);
            fixed (float* data = uvs)
            {
                Check(vrtm_asset_fetch_corner_uvs(asset, uvSet, data, (UIntPtr)(uvs.Length / 2)));
            }
        }

        /// <summary>Sizes of the mesh, such as its corners, and its tiles.</summary>
        public vrtm_asset_info Info
        {
            get
            {
                var info = vrtm_asset_info.Init();
                Check(vrtm_asset_get_info(asset, &info));
                return info;
            }
        }

        /// <summary>The asset for the functions of Vrtm.Api.</summary>
        public vrtm_asset Handle => asset;

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

        /// <summary>A tile of the first UV set, for the functions of Vrtm.Api.</summary>
        public vrtm_tile Tile(uint udim)
        {
            vrtm_tile tile;
            var key = new vrtm_tile_key { udim = udim };
            Check(vrtm_asset_find_tile(asset, &key, &tile));
            return tile;
        }

        /// <summary>Throws if a call of Vrtm.Api has failed on this thread.</summary>
        public static void Check(int status)
        {
            if (status != VRTM_OK)
            {
                throw new VrtmException(status, Utf8(vrtm_last_error()));
            }
        }

        /// <summary>Solves for a pose, if there is one, and fetches maps. Allocates nothing.</summary>
        private void Run(vrtm_array* points, vrtm_solve_options* options, Map[] maps)
        {
            var images = stackalloc vrtm_image_out[maps.Length];
            var fetches = stackalloc vrtm_fetch[maps.Length];
            var pinned = stackalloc GCHandle[maps.Length];
            var count = 0;
            try
            {
                foreach (var map in maps)
                {
                    CheckSize("Values", map.Values, Map.Channels(map.Kind), map.Width, map.Height);
                    if (!(map.Values is float[] || map.Values is ushort[]))
                    {
                        throw new ArgumentException($"Values: {map.Values.GetType()} is neither float[] nor ushort[]");
                    }
                    images[count] = vrtm_image_out.Init();
                    images[count].format = map.Values is float[] ? VRTM_PIXEL_F32 : VRTM_PIXEL_F16;
                    images[count].origin = map.FromBottom ? VRTM_ORIGIN_BOTTOM : VRTM_ORIGIN_TOP;
                    images[count].width = (uint)map.Width;
                    images[count].height = (uint)map.Height;
                    fetches[count] = vrtm_fetch.Init();
                    fetches[count].tile = Tile(map.Udim);
                    fetches[count].kind = map.Kind;
                    fetches[count].uv_set = map.UvSet;
                    fetches[count].image = &images[count];
                    pinned[count] = GCHandle.Alloc(map.Values, GCHandleType.Pinned);
                    images[count].data = (void*)pinned[count].AddrOfPinnedObject();
                    count++;
                }
                Check(points == null
                    ? vrtm_asset_fetch(fetches, (UIntPtr)count)
                    : vrtm_asset_redirect(asset, points, options, fetches, (UIntPtr)count));
            }
            finally
            {
                while (count > 0)
                {
                    pinned[--count].Free();
                }
                GC.KeepAlive(this); // Its finalizer would cancel the solve.
            }
        }

        private void FetchOne(string name, uint udim, int kind, Array values, int width, int height, bool fromBottom)
        {
            CheckSize(name, values, 2, width, height);
            one[0] = new Map { Udim = udim, Kind = kind, Values = values, Width = width, Height = height };
            one[0].FromBottom = fromBottom;
            Fetch(one);
        }

        private void CheckPose(float[] positions)
        {
            if (positions == null || positions.Length != 3 * vertices)
            {
                throw new ArgumentException($"positions: {positions?.Length ?? 0} numbers for {vertices} vertices");
            }
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

        private static void Warn(vrtm_log_entry entry, string message)
        {
            if (entry.level == VRTM_LOG_LEVEL_WARNING)
            {
                Console.Error.WriteLine("vrtm: " + message);
            }
        }

#if UNITY_5_3_OR_NEWER
        [AOT.MonoPInvokeCallback(typeof(vrtm_log_fn))] // For its compiler ahead of time.
#endif
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
