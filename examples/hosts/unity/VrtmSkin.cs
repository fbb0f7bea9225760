// Keeps painted features of a skinned mesh rigid, in Unity: put it beside a SkinnedMeshRenderer whose mesh may be read,
// with a rigidity map whose texture may be read (linear, R8). The solve runs on a thread of its own; the material gets
// the map one or two frames later, with the pose that it belongs to, as the texture _VrtmDelta:
//
//     float2 redirected = uv + tex2D(_VrtmDelta, uv).rg;
//     fixed4 colour = tex2Dgrad(_MainTex, redirected, ddx(redirected), ddy(redirected));
using System;
using System.Collections.Generic;
using System.Linq;
using System.Threading;
using UnityEngine;
using static Vrtm.Api;

[RequireComponent(typeof(SkinnedMeshRenderer))]
public sealed class VrtmSkin : MonoBehaviour
{
    [Tooltip("Red: 0 = elastic, 1 = rigid, for tile 1001.")]
    public Texture2D rigidity;
    [Tooltip("Texels of the map along each side.")]
    public int size = 512;
    [Tooltip("The quick quality.")]
    public bool draft = true;
    [Tooltip("Keep: studs and scales stay as large as they are at rest, for a body that swells. Follow: they grow " +
        "and shrink with the body, for a character under a scale control.")]
    public Sizes scale;
    [Tooltip("For posing by hand: a new pose ends the solve of the one before. Turn it off for an animation, where " +
        "solves that take longer than a frame would never come to their end.")]
    public bool newestPoseWins;
    [Tooltip("Shows the mesh in the pose that was solved last, so that paint does not swim. Put it on a child of " +
        "this object that is neither moved nor scaled.")]
    public MeshFilter shown;

    public enum Sizes
    {
        Keep = VRTM_SCALE_KEEP,
        Follow = VRTM_SCALE_FOLLOW,
    }

    private const uint Tile = 1001;
    private readonly AutoResetEvent posed = new AutoResetEvent(false);
    private readonly List<Vector3> points = new List<Vector3>();
    private SkinnedMeshRenderer skin;
    private Vrtm.Asset asset;
    private Mesh pose, last, next;
    private Texture2D delta;
    private float[] positions;
    private vrtm_solve_options options;
    private ushort[] halves;
    private Thread worker;
    private Exception failure;
    private volatile bool solving, ending;
    private bool solved;

    private void Start()
    {
        try
        {
            skin = GetComponent<SkinnedMeshRenderer>();
            var mesh = skin.sharedMesh;
            if (mesh == null || !mesh.isReadable)
            {
                throw new ArgumentException("the mesh cannot be read: turn on Read/Write where it is imported");
            }
            if (rigidity == null || !rigidity.isReadable)
            {
                throw new ArgumentException(
                    "rigidity cannot be read: set it, and turn on Read/Write where it is imported");
            }
            mesh.GetVertices(points);
            positions = new float[3 * points.Count];
            Flatten();
            var uvs = mesh.uv.SelectMany(uv => new[] { uv.x, uv.y }).ToArray();
            var corners = Array.ConvertAll(mesh.triangles, corner => (uint)corner);
            var label = $"vrtm, {name}: ";
            // Unity splits vertices along seams and hard edges.
            asset = new Vrtm.Asset(positions, null, corners, uvs, corners, weldByPosition: true, gpu: true,
                log: (entry, message) =>
                {
                    if (entry.level == VRTM_LOG_LEVEL_WARNING)
                    {
                        Debug.LogWarning(label + message);
                    }
                });
            asset.SetRigidity(Tile, Red(rigidity), rigidity.width, rigidity.height);
            halves = new ushort[2 * size * size];
            delta = new Texture2D(size, size, TextureFormat.RGHalf, false, true) { wrapMode = TextureWrapMode.Clamp };
            Upload();
            pose = new Mesh();
            last = new Mesh();
            next = new Mesh();
            (shown != null ? shown.GetComponent<Renderer>() : skin).material.SetTexture("_VrtmDelta", delta);
            worker = new Thread(Work) { IsBackground = true, Name = "vrtm" };
            worker.Start();
        }
        catch (Exception error)
        {
            Fail(error);
        }
    }

    private void LateUpdate()
    {
        if (solving)
        {
            if (newestPoseWins && HasMoved())
            {
                asset.Cancel();
            }
            return;
        }
        if (failure != null)
        {
            Fail(failure);
            return;
        }
        if (solved)
        {
            Upload();
            (pose, last) = (last, pose);
            if (shown != null)
            {
                shown.sharedMesh = last;
            }
        }
        Bake(pose);
        if (3 * points.Count != positions.Length)
        {
            Fail(new ArgumentException($"the mesh has {points.Count} vertices, and had {positions.Length / 3}"));
            return;
        }
        Flatten();
        options = vrtm_solve_options.Init();
        options.quality = draft ? VRTM_QUALITY_DRAFT : VRTM_QUALITY_NORMAL;
        options.scale = (int)scale;
        solving = true;
        posed.Set();
    }

    /// <summary>Solves pose after pose, on a thread of its own. No frame allocates, here or above.</summary>
    private void Work()
    {
        while (posed.WaitOne() && !ending)
        {
            try
            {
                solved = false;
                asset.Solve(positions, options);
                asset.FetchDelta(Tile, halves, size, size);
                solved = true;
            }
            catch (Vrtm.VrtmException error) when (error.Status == VRTM_ERROR_CANCELLED)
            {
                // The next pose is waiting.
            }
            catch (Exception error)
            {
                failure = error;
            }
            solving = false;
        }
    }

    private void OnDestroy()
    {
        ending = true;
        asset?.Cancel();
        posed.Set();
        worker?.Join();
        asset?.Dispose();
        Destroy(delta);
        Destroy(pose);
        Destroy(last);
        Destroy(next);
    }

    private void Fail(Exception error)
    {
        Debug.LogError($"vrtm, {name}: {error.Message}", this);
        enabled = false;
    }

    private void Upload()
    {
        delta.SetPixelData(halves, 0);
        delta.Apply(false);
    }

    private void Bake(Mesh mesh)
    {
        // In the units of the mesh: the transform's scale, 100 for many FBX files, is not part of the pose.
        skin.BakeMesh(mesh, true);
        mesh.GetVertices(points);
    }

    /// <summary>True if the pose is not the one that is being solved any more.</summary>
    private bool HasMoved()
    {
        Bake(next);
        for (var k = 0; k < points.Count && 3 * k < positions.Length; k++)
        {
            var point = points[k];
            if (point.x != positions[3 * k] || point.y != positions[3 * k + 1] || point.z != positions[3 * k + 2])
            {
                return true;
            }
        }
        return 3 * points.Count != positions.Length;
    }

    private void Flatten()
    {
        for (var k = 0; k < points.Count; k++)
        {
            var point = points[k];
            positions[3 * k] = point.x;
            positions[3 * k + 1] = point.y;
            positions[3 * k + 2] = point.z;
        }
    }

    /// <summary>The red channel, first row at v = 1; Unity's first row is v = 0.</summary>
    private static byte[] Red(Texture2D texture)
    {
        var pixels = texture.GetPixels32();
        var red = new byte[pixels.Length];
        for (var k = 0; k < red.Length; k++)
        {
            red[k] = pixels[(texture.height - 1 - k / texture.width) * texture.width + k % texture.width].r;
        }
        return red;
    }
}
