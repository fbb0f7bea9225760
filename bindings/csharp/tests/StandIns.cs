// Stands in for the few classes of Unity that examples/hosts/unity uses, so that the tests compile and run the
// component. None of them allocates for a frame.
using System;
using System.Collections.Generic;

namespace AOT
{
    public sealed class MonoPInvokeCallbackAttribute : Attribute
    {
        public MonoPInvokeCallbackAttribute(Type type)
        {
        }
    }
}

namespace UnityEngine
{
    public struct Vector2
    {
        public float x, y;
    }

    public struct Vector3
    {
        public float x, y, z;
    }

    public struct Color32
    {
        public byte r, g, b, a;
    }

    public enum TextureFormat
    {
        RGHalf,
    }

    public enum TextureWrapMode
    {
        Clamp,
    }

    public sealed class RequireComponentAttribute : Attribute
    {
        public RequireComponentAttribute(Type type)
        {
        }
    }

    public sealed class TooltipAttribute : Attribute
    {
        public TooltipAttribute(string tooltip)
        {
        }
    }

    public class Object
    {
        public string name;

        public static void Destroy(Object thing)
        {
        }
    }

    public class Material
    {
        public Texture2D texture;

        public void SetTexture(string name, Texture2D value) =>
            texture = name == "_VrtmDelta" ? value : null;
    }

    public class Component : Object
    {
        public SkinnedMeshRenderer skinned;

        public T GetComponent<T>() where T : Component => (T)(Component)skinned;
    }

    public class MonoBehaviour : Component
    {
        public bool enabled = true;
    }

    public class Renderer : Component
    {
        public Material material = new Material();
    }

    public class MeshFilter : Component
    {
        public Mesh sharedMesh;
    }

    public class SkinnedMeshRenderer : Renderer
    {
        public Mesh sharedMesh;
        public Vector3[] posed;
        public float scale = 1;

        /// <summary>Bakes in the units of the mesh if `useScale`, else as large as the transform makes it.</summary>
        public void BakeMesh(Mesh mesh, bool useScale = false)
        {
            mesh.vertices = mesh.vertices ?? new Vector3[posed.Length];
            var factor = useScale ? 1 : scale;
            for (var k = 0; k < posed.Length; k++)
            {
                var point = posed[k];
                mesh.vertices[k] = new Vector3 { x = factor * point.x, y = factor * point.y, z = factor * point.z };
            }
        }
    }

    public class Mesh : Object
    {
        public Vector3[] vertices;
        public Vector2[] uv;
        public int[] triangles;
        public bool isReadable = true;

        public void GetVertices(List<Vector3> found)
        {
            found.Clear();
            found.AddRange(vertices);
        }
    }

    public class Texture2D : Object
    {
        public readonly int width, height;
        public Color32[] pixels;
        public ushort[] shown;
        public TextureWrapMode wrapMode;
        public bool isReadable = true;
        private ushort[] set;

        public Texture2D(int width, int height, TextureFormat format = 0, bool mips = true, bool linear = false)
        {
            this.width = width;
            this.height = height;
        }

        public Color32[] GetPixels32() => pixels;

        public void SetPixelData(ushort[] data, int level)
        {
            set = set ?? new ushort[data.Length];
            data.CopyTo(set, 0);
        }

        public void Apply(bool mips)
        {
            shown = shown ?? new ushort[set.Length];
            set.CopyTo(shown, 0);
        }
    }

    public static class Debug
    {
        public static string error;
        public static volatile string warning;
        public static Action warned;

        public static void LogError(string message, Object context) => error = message;

        public static void LogWarning(string message)
        {
            warning = message;
            warned?.Invoke();
        }
    }
}
