// Keeps painted features of a skinned mesh rigid, in Unity: put it beside a SkinnedMeshRenderer whose mesh may be read, with a
// rigidity map whose texture may be read (linear, R8). The solve runs on a thread of its own; the material gets the map one or two
// frames later, with the pose that it belongs to, as the texture _VrtmDelta:
//
//     float2 redirected = uv + tex2D(_VrtmDelta, uv).rg;
//     fixed4 colour = tex2Dgrad(_MainTex, redirected, ddx(redirected), ddy(redirected));
using System;
using System.Threading.Tasks;
using UnityEngine;

[RequireComponent(typeof(SkinnedMeshRenderer))]
public sealed class VrtmSkin : MonoBehaviour
{
    /// <summary>Red: 0 = elastic, 1 = rigid, for tile 1001.</summary>
    public Texture2D rigidity;
    /// <summary>Texels of the map along each side.</summary>
    public int size = 512;
    /// <summary>The quick quality.</summary>
    public bool draft = true;
    /// <summary>Shows the mesh in the pose that was solved last, so that paint does not swim.</summary>
    public MeshFilter shown;

    private const uint Tile = 1001;
    private SkinnedMeshRenderer skin;
    private Vrtm.Asset asset;
    private Mesh pose, last;
    private Texture2D delta;
    private ushort[] halves;
    private Task solving;

    private void Start()
    {
        skin = GetComponent<SkinnedMeshRenderer>();
        var mesh = skin.sharedMesh;
        var uvs = mesh.uv;
        var flat = new float[2 * uvs.Length];
        for (var k = 0; k < uvs.Length; k++)
        {
            flat[2 * k] = uvs[k].x;
            flat[2 * k + 1] = uvs[k].y;
        }
        var corners = Array.ConvertAll(mesh.triangles, corner => (uint)corner);
        // Unity splits vertices along seams and hard edges.
        asset = new Vrtm.Asset(Flat(mesh.vertices), null, corners, flat, corners, weldByPosition: true, gpu: true);
        asset.SetRigidity(Tile, Red(rigidity), rigidity.width, rigidity.height);
        halves = new ushort[2 * size * size];
        delta = new Texture2D(size, size, TextureFormat.RGHalf, false, true) { wrapMode = TextureWrapMode.Clamp };
        delta.SetPixelData(halves, 0);
        delta.Apply(false);
        pose = new Mesh();
        last = new Mesh();
        (shown != null ? shown.GetComponent<Renderer>() : skin).material.SetTexture("_VrtmDelta", delta);
    }

    private void LateUpdate()
    {
        if (solving != null)
        {
            if (!solving.IsCompleted)
            {
                return;
            }
            if (solving.Exception != null)
            {
                Debug.LogError(solving.Exception.GetBaseException().Message, this);
                enabled = false;
                return;
            }
            delta.SetPixelData(halves, 0);
            delta.Apply(false);
            (pose, last) = (last, pose);
            if (shown != null)
            {
                shown.sharedMesh = last;
            }
        }
        skin.BakeMesh(pose);
        var positions = Flat(pose.vertices);
        solving = Task.Run(() =>
        {
            asset.Solve(positions, draft);
            asset.FetchDelta(Tile, halves, size, size);
        });
    }

    private void OnDestroy()
    {
        try
        {
            solving?.Wait();
        }
        catch (AggregateException)
        {
            // It was told, or nobody looks any more.
        }
        asset?.Dispose();
        Destroy(delta);
        Destroy(pose);
        Destroy(last);
    }

    private static float[] Flat(Vector3[] points)
    {
        var flat = new float[3 * points.Length];
        for (var k = 0; k < points.Length; k++)
        {
            flat[3 * k] = points[k].x;
            flat[3 * k + 1] = points[k].y;
            flat[3 * k + 2] = points[k].z;
        }
        return flat;
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
