// Stands in for the few classes of Unity that examples/hosts/unity uses, so that the tests compile and run the component.
using System;

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

    [AttributeUsage(AttributeTargets.Class)]
    public sealed class RequireComponentAttribute : Attribute
    {
        public RequireComponentAttribute(Type type)
        {
        }
    }

    public class Object
    {
        public static void Destroy(Object thing)
        {
        }
    }

    public class Material
    {
        public Texture2D texture;

        public void SetTexture(string name, Texture2D value)
        {
            texture = name == "_VrtmDelta" ? value : null;
        }
    }

    public class Component : Object
    {
        public SkinnedMeshRenderer skinned;

        public T GetComponent<T>() where T : Component
        {
            return (T)(Component)skinned;
        }
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

        public void BakeMesh(Mesh mesh)
        {
            mesh.vertices = posed;
        }
    }

    public class Mesh : Object
    {
        public Vector3[] vertices;
        public Vector2[] uv;
        public int[] triangles;
    }

    public class Texture2D : Object
    {
        public readonly int width, height;
        public Color32[] pixels;
        public ushort[] shown;
        public TextureWrapMode wrapMode;
        private ushort[] set;

        public Texture2D(int width, int height)
        {
            this.width = width;
            this.height = height;
        }

        public Texture2D(int width, int height, TextureFormat format, bool mips, bool linear) : this(width, height)
        {
        }

        public Color32[] GetPixels32()
        {
            return pixels;
        }

        public void SetPixelData(ushort[] data, int level)
        {
            set = (ushort[])data.Clone();
        }

        public void Apply(bool mips)
        {
            shown = set;
        }
    }

    public static class Debug
    {
        public static string error;

        public static void LogError(string message, Object context)
        {
            error = message;
        }
    }
}
