// Prints what the compiled binding says of the C ABI, one line a fact, for check_binding.py:
//   function NAME RETURN(TYPE NAME, ...) LIBRARY CONVENTION    struct NAME BYTES    field STRUCT NAME TYPE OFFSET BYTES
//   constant NAME VALUE
using System;
using System.Linq;
using System.Reflection;
using System.Runtime.CompilerServices;
using System.Runtime.InteropServices;
using DCloth;

internal static class DescribeBinding
{
    private const BindingFlags Declared =
        BindingFlags.Public | BindingFlags.Static | BindingFlags.Instance | BindingFlags.DeclaredOnly;

    private static string Name(Type type)
    {
        return type.IsPointer ? Name(type.GetElementType()) + "*" : type.Name;
    }

    private static void Functions()
    {
        foreach (MethodInfo method in typeof(Native).GetMethods(Declared).OrderBy(m => m.Name, StringComparer.Ordinal))
        {
            var import = method.GetCustomAttribute<DllImportAttribute>();
            string parameters =
                string.Join(", ", method.GetParameters().Select(p => Name(p.ParameterType) + " " + p.Name));
            Console.WriteLine("function {0} {1}({2}) {3} {4}", import == null ? method.Name : import.EntryPoint,
                              Name(method.ReturnType), parameters, import == null ? "none" : import.Value,
                              import == null ? "none" : import.CallingConvention.ToString());
        }
    }

    private static void Structs()
    {
        foreach (Type type in typeof(Native).Assembly.GetExportedTypes().Where(t => t.Name.StartsWith("dcloth_")))
        {
            FieldInfo[] fields = type.GetFields(Declared);
            Console.WriteLine("struct {0} {1}", type.Name, fields.Length == 0 ? 0 : Marshal.SizeOf(type));
            foreach (FieldInfo field in fields)
            {
                var buffer = field.GetCustomAttribute<FixedBufferAttribute>();
                string kind = buffer == null ? Name(field.FieldType)
                                             : Name(buffer.ElementType) + "[" + buffer.Length + "]";
                int bytes = field.FieldType.IsPointer ? IntPtr.Size : Marshal.SizeOf(field.FieldType);
                Console.WriteLine("field {0} {1} {2} {3} {4}", type.Name, field.Name, kind,
                                  Marshal.OffsetOf(type, field.Name), bytes);
            }
        }
    }

    private static int Main()
    {
        Functions();
        Structs();
        foreach (FieldInfo field in typeof(Native).GetFields(Declared).Where(f => f.Name != "Library"))
            Console.WriteLine("constant {0} {1}", field.Name, field.GetRawConstantValue());
        return 0;
    }
}
